// The residual over time or against a quantity: a strip for each coordinate.
import { ink, micro } from "../format.js";
import { Dots } from "./dots.js";

const MARGIN = { left: 56, right: 12, top: 12, bottom: 34 };

export class AgainstView {
  // quantity: of the rows, by the server's name; name: for display
  constructor(quantity, name) {
    Object.assign(this, { quantity, name, dots: new Dots() });
  }

  layout(rows, largest, width, height) {
    const finite = rows[this.quantity].filter(Number.isFinite);
    const [low, high] = [finite.reduce((a, b) => Math.min(a, b), Infinity), finite.reduce((a, b) => Math.max(a, b), -Infinity)];
    Object.assign(this, { low, span: high - low || 1, strip: (height - MARGIN.top - MARGIN.bottom) / rows.labels.length, wide: width - MARGIN.left - MARGIN.right, largest: largest || 1 });
    this.note = `${this.name} from ${low.toPrecision(4)} to ${high.toPrecision(4)}; strips end at ±${largest.toFixed(2)} ${micro(rows.unit)}. Draw around points to choose rows.`;
  }

  middle(coordinate) {
    return MARGIN.top + (coordinate + 0.5) * this.strip;
  }

  // (2 n m) x and y of every coordinate of every row.
  marks(rows, residual) {
    const [along, m] = [rows[this.quantity], rows.labels.length];
    const marks = new Float32Array(2 * residual.length);
    for (let k = 0; k < residual.length; k++) {
      marks[2 * k] = MARGIN.left + ((along[(k / m) | 0] - this.low) / this.span) * this.wide;
      marks[2 * k + 1] = this.middle(k % m) - (residual[k] / this.largest) * (this.strip / 2);
    }
    return marks;
  }

  paint(context, rows, residual, marks, shown) {
    const m = rows.labels.length;
    this.dots.paint(context, marks, (k) => shown((k / m) | 0));
  }

  frame(context, rows, width) {
    rows.labels.forEach((label, k) => {
      context.strokeStyle = ink("--rule");
      context.beginPath();
      context.moveTo(MARGIN.left, this.middle(k));
      context.lineTo(width - MARGIN.right, this.middle(k));
      context.stroke();
      context.fillStyle = ink("--soft");
      context.fillText(label, 8, this.middle(k) + 4);
    });
  }
}
