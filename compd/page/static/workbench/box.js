// What stands around arrows in three dimensions: the box of the measured places with numbers, and the machine.
import { ink } from "../format.js";
import { label, stroke, ticks } from "./ticks.js";

// From a number at an axis, and from the title, to the axis.
const NUMBER_PX = 16;
const TITLE_PX = 40;
// A shorter edge is seen from its end.
const SHORTEST_PX = 40;
const TICK_APART_PX = 45;

// The edges of the box, and for each axis the edge that is the lowest, or for z the leftmost, with its numbers.
export function drawBox(context, project, { low, high }, unit, per_mm) {
  const corner = (x, y, z) => [[low, high][x][0], [low, high][y][1], [low, high][z][2]];
  const centre = project(low.map((value, axis) => (value + high[axis]) / 2));
  for (const axis of [0, 1, 2]) {
    const edges = [[0, 0], [0, 1], [1, 0], [1, 1]].map((others) => [0, 1].map((end) => corner(...[0, 1, 2].map((k) => (k === axis ? end : others[k > axis ? k - 1 : k])))));
    for (const [from, to] of edges) stroke(context, "--rule", ...project(from), ...project(to));
    const seen = edges.map(([from, to]) => ({ from, to, ends: [project(from), project(to)] }));
    const outermost = ({ ends: [a, b] }) => (axis === 2 ? -(a[0] + b[0]) : a[1] + b[1]);
    drawAxis(context, project, seen.sort((a, b) => outermost(b) - outermost(a))[0], axis, centre, unit, per_mm);
  }
}

function drawAxis(context, project, { from, to, ends: [[x0, y0], [x1, y1]] }, axis, centre, unit, per_mm) {
  const px = Math.hypot(x1 - x0, y1 - y0);
  if (px < SHORTEST_PX) return;
  const name = "xyz"[axis];
  context.lineWidth = 2;
  stroke(context, `--${name}`, x0, y0, x1, y1);
  context.lineWidth = 1;
  // across the edge, away from the middle of the box
  let away = [-(y1 - y0) / px, (x1 - x0) / px];
  if (away[0] * ((x0 + x1) / 2 - centre[0]) + away[1] * ((y0 + y1) / 2 - centre[1]) < 0) away = away.map((value) => -value);
  label(context);
  context.textAlign = "center";
  for (const [value, text] of ticks(from[axis] * per_mm, to[axis] * per_mm, Math.max(2, Math.floor(px / TICK_APART_PX)))) {
    const place = [...from];
    place[axis] = value / per_mm;
    const [x, y] = project(place);
    stroke(context, "--soft", x, y, x + 5 * away[0], y + 5 * away[1]);
    context.fillText(text, x + 1.4 * NUMBER_PX * away[0], y + NUMBER_PX * away[1] + 4);
  }
  context.fillStyle = ink("--ink");
  const lowest = context.canvas.height / context.getTransform().d - 4;
  context.fillText(`${name}, ${unit}`, (x0 + x1) / 2 + 1.5 * TITLE_PX * away[0], Math.min(lowest, (y0 + y1) / 2 + TITLE_PX * away[1] + 4));
  context.textAlign = "left";
}

// Lines of the machine at machine zero: rods and what is drawn around them.
export function drawMachine(context, project, machine) {
  for (const { part, points, closed } of machine) {
    context.strokeStyle = ink(part === "platform" ? "--good" : "--gone");
    context.lineWidth = part === "rod" ? 3 : 1.5;
    context.beginPath();
    points.map(project).forEach(([x, y], k) => (k ? context.lineTo(x, y) : context.moveTo(x, y)));
    if (closed) context.closePath();
    context.globalAlpha = 0.6;
    context.stroke();
    context.globalAlpha = 1;
  }
  context.lineWidth = 1;
}
