// The residual in x and y as shots at a target; the rings stay fixed during a trial.
import { ink, micro } from "../format.js";
import { Pixels } from "./pixels.js";
import { label, stroke, ticks } from "./ticks.js";

const MARGIN_PX = 40;
const MOST_RINGS = 4;

export class TargetView {
  constructor() {
    this.pixels = new Pixels();
  }

  layout(rows, largest, width, height) {
    Object.assign(this, { radius: Math.min(width, height) / 2 - MARGIN_PX, x: width / 2, y: height / 2, largest: largest || 1 });
    this.note = `x to the right, y up, ${micro(rows.unit)}; the rings stay as they are while you try. Draw around points to choose rows.`;
  }

  // (2 n) x and y of every row.
  marks(rows, residual) {
    const marks = new Float32Array((2 * residual.length) / 3);
    for (let row = 0; row < marks.length / 2; row++) {
      marks[2 * row] = this.x + (residual[3 * row] / this.largest) * this.radius;
      marks[2 * row + 1] = this.y - (residual[3 * row + 1] / this.largest) * this.radius;
    }
    return marks;
  }

  paint(context, rows, residual, marks, shown) {
    this.pixels.dots(context, marks, shown);
  }

  frame(context, rows) {
    const { x, y, radius } = this;
    stroke(context, "--x", x - radius, y, x + radius, y);
    stroke(context, "--y", x, y - radius, x, y + radius);
    label(context);
    for (const [value, text] of ticks(0, this.largest, MOST_RINGS).slice(1)) {
      const ring = (value / this.largest) * radius;
      context.strokeStyle = ink("--rule");
      context.beginPath();
      context.arc(x, y, ring, 0, 7);
      context.stroke();
      context.fillText(`${text} ${micro(rows.unit)}`, x + 4, y - ring + 12);
    }
    context.fillStyle = ink("--ink");
    context.fillText(`x, ${micro(rows.unit)}`, x + radius + 6, y + 4);
    context.fillText(`y, ${micro(rows.unit)}`, x - 14, y - radius - 8);
  }
}
