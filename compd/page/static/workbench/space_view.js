// Rows at their measured places with residuals as arrows: in three dimensions, or as a map.
import { ink, micro } from "../format.js";

// The longest arrow is this share of the picture's radius.
const LONGEST = 0.25;
const MAP_MARGIN_PX = 30;

export class SpaceView {
  // projector: (places, width, height) -> a function of a place that gives x and y on the canvas, with its `radius` in mm
  constructor(projector, hint, axes = null) {
    Object.assign(this, { projector, hint, axes });
  }

  layout(rows, largest, width, height) {
    const project = this.projector(rows.place_mm, width, height);
    const [x0, y0] = project([0, 0, 0]);
    this.origin = [x0, y0];
    // a projection without perspective is linear
    this.unit = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis) => project(axis)).map(([x, y]) => [x - x0, y - y0]);
    this.times = (LONGEST * project.radius) / (largest || 1);
    this.note = `arrows ${Math.round(this.times * 1000)} times longer than the residual; the longest is ${largest.toFixed(2)} ${micro(rows.unit)}. ${this.hint}`;
  }

  // (2 n) x and y of every row.
  marks(rows) {
    const [[xx, xy], [yx, yy], [zx, zy]] = this.unit;
    const [x0, y0] = this.origin;
    const places = rows.place_mm;
    const marks = new Float32Array((2 * places.length) / 3);
    for (let row = 0; row < marks.length / 2; row++) {
      const [x, y, z] = [places[3 * row], places[3 * row + 1], places[3 * row + 2]];
      marks[2 * row] = x0 + x * xx + y * yx + z * zx;
      marks[2 * row + 1] = y0 + x * xy + y * yy + z * zy;
    }
    return marks;
  }

  paint(context, rows, residual, marks, shown) {
    const [[xx, xy], [yx, yy], [zx, zy]] = this.unit;
    context.beginPath();
    for (let row = 0; row < marks.length / 2; row++) {
      if (!shown(row)) continue;
      const [x, y, z] = [residual[3 * row] * this.times, residual[3 * row + 1] * this.times, residual[3 * row + 2] * this.times];
      const [from, across] = [marks[2 * row], marks[2 * row + 1]];
      context.moveTo(from, across);
      context.lineTo(from + x * xx + y * yx + z * zx, across + x * xy + y * yy + z * zy);
    }
    context.stroke();
  }

  frame(context, rows, width, height) {
    if (!this.axes) return;
    context.fillStyle = ink("--soft");
    context.fillText(`${this.axes[0]}, mm →`, width - 64, height - 8);
    context.fillText(`↑ ${this.axes[1]}, mm`, 8, 14);
    const px_per_mm = Math.max(...this.unit.flat().map(Math.abs));
    const length = [1000, 500, 200, 100, 50, 20, 10, 5, 2, 1].find((mm) => mm * px_per_mm < width / 3) ?? 1;
    context.fillRect(8, height - 22, length * px_per_mm, 2);
    context.fillText(`${length} mm`, 8, height - 8);
  }
}

// The projector of a map: two axes of three, as large as fits.
export function mapped(across, up) {
  return (places, width, height) => {
    const [low, high] = [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]];
    for (let k = 0; k < places.length; k++) {
      if (!Number.isFinite(places[k])) continue;
      low[k % 3] = Math.min(low[k % 3], places[k]);
      high[k % 3] = Math.max(high[k % 3], places[k]);
    }
    const [wide, tall] = [high[across] - low[across] || 1, high[up] - low[up] || 1];
    const scale = Math.min((width - 2 * MAP_MARGIN_PX) / wide, (height - 2 * MAP_MARGIN_PX) / tall);
    const middle = (axis) => (low[axis] + high[axis]) / 2;
    const project = (place) => [width / 2 + scale * (place[across] - middle(across)), height / 2 - scale * (place[up] - middle(up))];
    project.radius = Math.hypot(wide, tall) / 2;
    return project;
  };
}
