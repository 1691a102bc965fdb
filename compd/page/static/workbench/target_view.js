// The residual in x and y as shots at a target; the rings stay fixed during a trial.
import { ink, micro } from "../format.js";
import { Dots } from "./dots.js";

export class TargetView {
  constructor() {
    this.dots = new Dots();
  }

  layout(rows, largest, width, height) {
    Object.assign(this, { radius: Math.min(width, height) / 2 - 24, x: width / 2, y: height / 2, largest: largest || 1 });
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
    this.dots.paint(context, marks, shown);
  }

  frame(context) {
    context.strokeStyle = ink("--rule");
    context.fillStyle = ink("--soft");
    for (const share of [0.25, 0.5, 0.75, 1]) {
      context.beginPath();
      context.arc(this.x, this.y, share * this.radius, 0, 7);
      context.stroke();
      context.fillText((share * this.largest).toFixed(2), this.x + 4, this.y - share * this.radius + 12);
    }
  }
}
