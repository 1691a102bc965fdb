// A line drawn around marks, by mouse or finger.
import { ink } from "../format.js";

const MIN_STEP_PX = 3;

export class Lasso {
  // wanted: whether a press begins a lasso (event -> bool); around: called with a function of x and y, true inside
  constructor(canvas, { wanted, draw, around }) {
    this.line = [];
    canvas.addEventListener("pointerdown", (event) => {
      if (!wanted(event)) return;
      event.stopImmediatePropagation();
      canvas.setPointerCapture(event.pointerId);
      this.line = [[event.offsetX, event.offsetY]];
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!this.line.length) return;
      event.stopImmediatePropagation();
      const [x, y] = this.line.at(-1);
      if (Math.hypot(event.offsetX - x, event.offsetY - y) < MIN_STEP_PX) return;
      this.line.push([event.offsetX, event.offsetY]);
      draw();
    });
    canvas.addEventListener("pointerup", (event) => {
      if (!this.line.length) return;
      event.stopImmediatePropagation();
      const line = this.line;
      this.line = [];
      around(line.length > 2 ? inside(line) : near(line[0]));
    });
  }

  draw(context) {
    if (!this.line.length) return;
    context.strokeStyle = ink("--line");
    context.setLineDash([5, 4]);
    context.beginPath();
    this.line.forEach(([x, y]) => context.lineTo(x, y));
    context.closePath();
    context.stroke();
    context.setLineDash([]);
  }
}

// A place is inside where a ray from it crosses the line an odd number of times.
function inside(line) {
  return (x, y) => {
    let odd = false;
    line.forEach(([x1, y1], k) => {
      const [x0, y0] = line[(k || line.length) - 1];
      if (y1 > y !== y0 > y && x < ((x0 - x1) * (y - y1)) / (y0 - y1) + x1) odd = !odd;
    });
    return odd;
  };
}

// A press without a line chooses the mark beneath it.
function near([x0, y0]) {
  return (x, y) => Math.hypot(x - x0, y - y0) < 6;
}
