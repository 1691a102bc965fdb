// The residual over time or against a quantity: a strip for each coordinate.
import { ink, micro } from "../format.js";
import { Pixels } from "./pixels.js";
import { axisBelow, axisLeft, stroke } from "./ticks.js";
import { bounds } from "./space_view.js";

const MARGIN = { left: 64, right: 16, top: 12, bottom: 44 };
// Between two strips.
const GAP_PX = 6;

export class AgainstView {
  // quantity: of the rows, by the server's name; title: of its axis, with the unit
  constructor(quantity, title) {
    Object.assign(this, { quantity, title, pixels: new Pixels() });
  }

  layout(rows, largest, width, height) {
    if (this.rows !== rows) this.range = bounds([...rows[this.quantity]].flatMap((value) => [value, 0, 0]));
    this.rows = rows;
    const [low, high] = [this.range.low[0], this.range.high[0]];
    Object.assign(this, { low, high, span: high - low || 1, strip: (height - MARGIN.top - MARGIN.bottom) / rows.labels.length, wide: width - MARGIN.left - MARGIN.right, largest: largest || 1 });
    this.note = "Draw around points to choose rows.";
  }

  middle(coordinate) {
    return MARGIN.top + (coordinate + 0.5) * this.strip;
  }

  // From a residual to the place above the middle of its strip.
  above(value) {
    return (value / this.largest) * (this.strip / 2 - GAP_PX / 2);
  }

  // (2 n m) x and y of every coordinate of every row.
  marks(rows, residual) {
    const [along, m] = [rows[this.quantity], rows.labels.length];
    const marks = new Float32Array(2 * residual.length);
    for (let k = 0; k < residual.length; k++) {
      marks[2 * k] = MARGIN.left + ((along[(k / m) | 0] - this.low) / this.span) * this.wide;
      marks[2 * k + 1] = this.middle(k % m) - this.above(residual[k]);
    }
    return marks;
  }

  paint(context, rows, residual, marks, shown) {
    const m = rows.labels.length;
    this.pixels.dots(context, marks, (k) => shown((k / m) | 0));
  }

  frame(context, rows, width, height) {
    const [left, right] = [MARGIN.left, width - MARGIN.right];
    rows.labels.forEach((name, k) => {
      const middle = this.middle(k);
      const half = this.above(this.largest);
      axisLeft(context, { low: -this.largest, high: this.largest, top: middle - half, bottom: middle + half, x: left, title: `${name}, ${micro(rows.units[k])}`, at: (value) => middle - this.above(value), grid: right - left });
      stroke(context, "--soft", left, middle, right, middle);
      if (!"xyz".includes(name)) return;
      context.fillStyle = ink(`--${name}`);
      context.fillRect(left - 1, middle - half, 3, 2 * half);
    });
    axisBelow(context, { low: this.low, high: this.high, left, right, y: height - MARGIN.bottom + 2, title: this.title, at: (value) => left + ((value - this.low) / this.span) * this.wide });
  }
}
