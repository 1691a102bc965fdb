// Rows at their measured places with residuals as arrows: in three dimensions, or as a map.
import { amounts, micro } from "../format.js";
import { drawBox, drawMachine } from "./box.js";
import { Pixels } from "./pixels.js";
import { axisBelow, axisLeft, scaleBar } from "./ticks.js";

// The longest arrow is this share of the picture's radius.
const LONGEST = 0.25;
const MARGIN = { left: 64, right: 20, top: 30, bottom: 44 };
const UNITS = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];

export class SpaceView {
  // projector: (places, width, height) -> a function of a place that gives x and y on the canvas, with its `px_per_mm`
  // axes: of a map, such as "xy"; none of a picture in three dimensions, which shows the machine, too
  constructor(projector, hint, axes = null) {
    Object.assign(this, { projector, hint, axes, pixels: new Pixels(), machine: !axes });
  }

  layout(rows, largest, width, height) {
    if (this.rows !== rows) this.bounds = bounds(rows.place_mm);
    this.rows = rows;
    const { low, high } = this.bounds;
    const machine = this.machine ? (rows.machine ?? []) : [];
    const project = this.projector([...low, ...high, ...machine.flatMap(({ points }) => points.flat())], width, height);
    const [x0, y0] = project([0, 0, 0]);
    this.origin = [x0, y0];
    // a projection without perspective is linear
    this.unit = UNITS.map((axis) => project(axis)).map(([x, y]) => [x - x0, y - y0]);
    const seen = this.axes ? [..."xyz"].filter((axis) => this.axes.includes(axis)).map((axis) => "xyz".indexOf(axis)) : [0, 1, 2];
    const radius = Math.hypot(...seen.map((axis) => high[axis] - low[axis])) / 2 || 1;
    this.times = (LONGEST * radius) / (largest || 1);
    Object.assign(this, { project, width, height });
    this.note = `arrows ${Math.round(this.times * 1000)} times longer than the residual; the longest is ${amounts([largest], rows.unit)}. ${this.hint}`;
  }

  // (2 n) x and y of every row.
  marks(rows) {
    return this.projected(rows.place_mm, 1, this.origin);
  }

  // (2 n) x and y of vectors, so many times larger.
  projected(vectors, times, [x0, y0]) {
    const [[xx, xy], [yx, yy], [zx, zy]] = this.unit;
    const marks = new Float32Array((2 * vectors.length) / 3);
    for (let row = 0; row < marks.length / 2; row++) {
      const x = times * vectors[3 * row];
      const y = times * vectors[3 * row + 1];
      const z = times * vectors[3 * row + 2];
      marks[2 * row] = x0 + x * xx + y * yx + z * zx;
      marks[2 * row + 1] = y0 + x * xy + y * yy + z * zy;
    }
    return marks;
  }

  paint(context, rows, residual, marks, shown) {
    this.pixels.arrows(context, marks, this.projected(residual, this.times, [0, 0]), shown);
  }

  frame(context, rows, width, height) {
    const { low, high } = this.bounds;
    const [unit, per_mm] = placeUnit(rows.unit);
    if (this.axes) {
      const [across, up] = [...this.axes].map((axis) => "xyz".indexOf(axis));
      const [left, right, top, bottom] = [MARGIN.left, width - MARGIN.right, MARGIN.top, height - MARGIN.bottom];
      const { px_per_mm } = this.project;
      const [middle_x, middle_y] = [(low[across] + high[across]) / 2, (low[up] + high[up]) / 2];
      const [wide, tall] = [(right - left) / 2 / px_per_mm, (bottom - top) / 2 / px_per_mm];
      axisBelow(context, { low: (middle_x - wide) * per_mm, high: (middle_x + wide) * per_mm, left, right, y: bottom, title: `${this.axes[0]}, ${unit}`, at: (value) => (left + right) / 2 + (value / per_mm - middle_x) * px_per_mm, grid: bottom - top });
      axisLeft(context, { low: (middle_y - tall) * per_mm, high: (middle_y + tall) * per_mm, top, bottom, x: left, title: `${this.axes[1]}, ${unit}`, at: (value) => (top + bottom) / 2 - (value / per_mm - middle_y) * px_per_mm, grid: right - left });
    } else {
      if (this.machine) drawMachine(context, this.project, rows.machine ?? []);
      drawBox(context, this.project, this.bounds, unit, per_mm);
    }
    scaleBar(context, { x: 12, y: 14, per_px: 1 / (this.times * this.project.px_per_mm), unit: micro(rows.unit), longest_px: 90 });
  }
}

// Lowest and highest finite number of each coordinate.
export function bounds(places) {
  const [low, high] = [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]];
  for (let k = 0; k < places.length; k++) {
    if (!Number.isFinite(places[k])) continue;
    low[k % 3] = Math.min(low[k % 3], places[k]);
    high[k % 3] = Math.max(high[k % 3], places[k]);
  }
  return { low, high };
}

// The unit of places, and how many of it are a mm: of a residual in another unit than µm, one counts as one µm.
export function placeUnit(unit) {
  return unit === "um" ? ["mm", 1] : [micro(unit), 1000];
}

// The projector of a map: two axes of three, as large as fits between its axes.
export function mapped(across, up, margin = MARGIN) {
  return (places, width, height) => {
    const { low, high } = bounds(places);
    const [wide, tall] = [high[across] - low[across] || 1, high[up] - low[up] || 1];
    const [room, tall_room] = [width - margin.left - margin.right, height - margin.top - margin.bottom];
    // arrows reach beyond the outermost places
    const scale = Math.min(room / wide, tall_room / tall) * (1 - LONGEST);
    const middle = (axis) => (low[axis] + high[axis]) / 2;
    const [x, y] = [margin.left + room / 2, margin.top + tall_room / 2];
    const project = (place) => [x + scale * (place[across] - middle(across)), y - scale * (place[up] - middle(up))];
    project.px_per_mm = scale;
    return project;
  };
}
