// The agreement of the instrument's motion with the scales, over the offset between their clocks.
import { ink, prepared } from "../format.js";
import { Axes } from "./axes.js";

// Share of the width for the enlarged surroundings of the best offset.
const NEAR = 0.35;
// Agreement by which the curve is visibly above the next best.
const HIGHER = 0.02;

export class AgreementPicture {
  constructor(canvas) {
    this.canvas = canvas;
  }

  // Draws it; returns a description.
  draw({ offset_s, agreement, window_s, peak, next_best }) {
    const { context, width, height } = prepared(this.canvas);
    const wide = peak ? (1 - NEAR) * width : width;
    const all = new Axes(context, { left: 0, top: 0, width: wide, height }, [offset_s[0], offset_s.at(-1)], [0, 1]);
    all.label("clock offset, s", "agreement", [1, 0]);
    this.curve(all, offset_s, agreement);
    this.mark(all, next_best, "--care", "next best");
    this.mark(all, peak, "--good", "best");
    if (!peak) return "No offset is clearly the best. 1: the scales explain all of the instrument's motion.";
    const near = new Axes(context, { left: wide, top: 0, width: width - wide, height }, [peak[0] - window_s, peak[0] + window_s], [0, 1]);
    near.label("near the best, s", "", [1, 0]);
    this.curve(near, offset_s, agreement);
    this.mark(near, peak, "--good", "");
    const next = next_best ? `; the next best, ${next_best[1].toFixed(4)}, at ${next_best[0].toFixed(2)} s` : "; there is no other";
    const higher = this.uncounted({ offset_s, agreement, window_s, peak, next_best });
    return `Best agreement ${peak[1] === null ? "not known" : peak[1].toFixed(4)} at an offset of ${peak[0].toFixed(3)} s${next}. 1: the scales explain all of the instrument's motion.${higher}`;
  }

  // Why the curve is higher than the next best somewhere else.
  uncounted({ offset_s, agreement, window_s, peak, next_best }) {
    const least = (next_best?.[1] ?? 0) + HIGHER;
    const [value, at] = agreement.reduce((best, value, k) => (value > best[0] && Math.abs(offset_s[k] - peak[0]) > window_s ? [value, offset_s[k]] : best), [least, null]);
    if (at === null) return "";
    return ` The curve reaches ${value.toFixed(2)} at ${at.toFixed(1)} s, which does not count: an offset counts where at least half of the shorter of the two overlaps, and both move at the same times.`;
  }

  // nan for too little overlap; below 0 there is no agreement.
  curve(axes, offset_s, agreement) {
    const { context } = axes;
    context.strokeStyle = ink("--line");
    context.beginPath();
    let pen = false;
    offset_s.forEach((offset, k) => {
      const inside = agreement[k] !== null && offset >= axes.x[0] && offset <= axes.x[1];
      if (inside) context[pen ? "lineTo" : "moveTo"](...axes.at(offset, Math.max(0, agreement[k])));
      pen = inside;
    });
    context.stroke();
  }

  mark(axes, point, colour, text) {
    if (!point || point[1] === null) return;
    const { context } = axes;
    const [x, y] = axes.at(point[0], Math.max(0, point[1]));
    const toLeft = x > (axes.left + axes.right) / 2;
    context.fillStyle = ink(colour);
    context.beginPath();
    context.arc(x, y, 5, 0, 7);
    context.fill();
    context.fillStyle = ink("--ink");
    context.textAlign = toLeft ? "right" : "left";
    context.fillText(text, x + (toLeft ? -9 : 9), y + 14);
    context.textAlign = "left";
  }
}
