// The frame of a picture: from numbers to places on a canvas, with numbers at its ends.
import { ink } from "../format.js";

const MARGIN = { left: 56, right: 16, top: 14, bottom: 36 };

export class Axes {
  // area: { left, top, width, height } on the canvas; x, y: [lowest, highest]
  constructor(context, area, x, y) {
    Object.assign(this, { context, x, y, left: area.left + MARGIN.left, right: area.left + area.width - MARGIN.right, top: area.top + MARGIN.top, bottom: area.top + area.height - MARGIN.bottom });
    context.font = "12px system-ui";
    context.strokeStyle = ink("--rule");
    context.strokeRect(this.left, this.top, this.right - this.left, this.bottom - this.top);
  }

  at(x, y) {
    const across = (x - this.x[0]) / (this.x[1] - this.x[0] || 1);
    const up = (y - this.y[0]) / (this.y[1] - this.y[0] || 1);
    return [this.left + across * (this.right - this.left), this.bottom - up * (this.bottom - this.top)];
  }

  // Labels of the axes, with numbers of this many digits at their ends.
  label(xText, yText, digits) {
    const { context, left, right, top, bottom } = this;
    const text = (align, words, x, y) => {
      context.textAlign = align;
      context.fillText(words, x, y);
    };
    context.fillStyle = ink("--soft");
    text("left", this.x[0].toFixed(digits[0]), left, bottom + 16);
    text("right", this.x[1].toFixed(digits[0]), right, bottom + 16);
    text("right", this.y[1].toFixed(digits[1]), left - 6, top + 10);
    text("right", this.y[0].toFixed(digits[1]), left - 6, bottom);
    text("center", xText, (left + right) / 2, bottom + 30);
    context.save();
    context.translate(left - 42, (top + bottom) / 2);
    context.rotate(-Math.PI / 2);
    text("center", yText, 0, 0);
    context.restore();
    context.textAlign = "left";
  }
}
