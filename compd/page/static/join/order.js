// Assignment of points to the machine's dwells, and their distances after registration.
import { ink, prepared } from "../format.js";
import { Axes } from "./axes.js";

// Share of the width for the assignment; the rest shows the distances.
const ORDER = 0.5;

export class OrderPicture {
  constructor(canvas) {
    this.canvas = canvas;
  }

  // Draws it; returns a description. Points without a dwell are on the lowest line.
  draw({ line, dwell_number, residual_um, dwells }) {
    const { context, width, height } = prepared(this.canvas);
    const lines = [line[0], line.at(-1)];
    const largest = residual_um.reduce((most, value) => Math.max(most, value ?? 0), 0);
    const order = new Axes(context, { left: 0, top: 0, width: ORDER * width, height }, lines, [0, dwells]);
    const far = new Axes(context, { left: ORDER * width, top: 0, width: (1 - ORDER) * width, height }, lines, [0, largest]);
    order.label("line of the export", "dwell of the machine", [0, 0]);
    far.label("line of the export", "distance from the dwell, µm", [0, 1]);
    const [colour, without_dwell] = [ink("--line"), ink("--bad")];
    line.forEach((number, k) => {
      const joined = dwell_number[k] > 0;
      context.fillStyle = joined ? colour : without_dwell;
      const [x, y] = order.at(number, dwell_number[k]);
      context.fillRect(x - 2, y - 2, 4, 4);
      if (!joined) return;
      const [at, top] = far.at(number, residual_um[k]);
      context.fillRect(at - 0.75, top, 1.5, far.bottom - top);
    });
    const without = dwell_number.filter((number) => number === 0).length;
    return `${line.length - without} points at their dwells, the farthest ${largest.toFixed(1)} µm from its own${without ? `; ${without} without a dwell, on the lowest line` : ""}.`;
  }
}
