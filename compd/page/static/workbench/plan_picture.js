// The rows of a plan in space: numbered, coloured by a setting, with the difference of the rivals.
import { element, ink, prepared } from "../format.js";
import { Turn } from "../orbit_control.js";
import { drawBox } from "./box.js";
import { bounds } from "./space_view.js";
import { scaleBar } from "./ticks.js";

const NO_COLOUR = "purpose";
// The longest arrow is this share of the picture's radius.
const LONGEST = 0.3;
const SETTLED = ["row", "purpose", "tip_x_mm", "tip_y_mm", "tip_z_mm"];

export class PlanPicture {
  constructor() {
    this.canvas = element("canvas", { id: "plan-picture", tabindex: 0, role: "img", "aria-label": "The planned rows in space" });
    this.by = element("select", { "aria-label": "Colour", onchange: () => this.draw() });
    this.note = element("p", { class: "note" });
    this.place = element("div", {}, element("label", {}, "Colour by ", this.by), this.canvas, this.note);
    this.plan = null;
    this.turn = new Turn(this.canvas, () => this.draw());
  }

  show(plan) {
    this.plan = plan;
    this.place.hidden = !plan.place.length;
    const varied = plan.columns.filter((name, k) => !SETTLED.includes(name) && new Set(plan.rows.map((row) => row[k])).size > 1);
    const first = varied.find((name) => /^(force|temperature)_/.test(name)) ?? varied[0];
    this.by.replaceChildren(element("option", { value: NO_COLOUR }, "nothing"), ...varied.map((name) => element("option", { value: name, selected: name === first }, name)));
    this.draw();
  }

  draw() {
    const { context, width, height } = prepared(this.canvas);
    if (!this.plan?.place.length) return;
    const { place, columns, rows, difference_um: difference, rivals } = this.plan;
    const project = this.turn.projector(place.flat(), width, height);
    const at = place.map(project);
    drawBox(context, project, bounds(place.flat()), "mm", 1);
    context.font = "11px system-ui";
    context.strokeStyle = ink("--rule");
    context.beginPath();
    for (const point of at) context.lineTo(...point);
    context.stroke();
    const arrows = difference.length && difference[0].length === 3;
    const largest = Math.max(...difference.map((row) => Math.hypot(...row)), 1e-9);
    if (arrows) {
      scaleBar(context, { x: 12, y: 14, per_px: largest / (LONGEST * project.radius * project.px_per_mm), unit: "µm", longest_px: 90, colour: "--bad" });
      context.strokeStyle = ink("--bad");
      context.beginPath();
      place.forEach((point, k) => {
        context.moveTo(...at[k]);
        context.lineTo(...project(point.map((value, i) => value + (LONGEST * project.radius * difference[k][i]) / largest)));
      });
      context.stroke();
    }
    const k = columns.indexOf(this.by.value);
    const values = k < 0 || this.by.value === NO_COLOUR ? null : rows.map((row) => row[k]);
    const [low, high] = values ? [Math.min(...values), Math.max(...values)] : [0, 1];
    // several rows may share a place: their numbers are side by side
    const taken = new Map();
    at.forEach((point, row) => {
      const share = values ? (values[row] - low) / (high - low || 1) : 0.5;
      context.fillStyle = values ? `color-mix(in oklab, #d55e00 ${100 * share}%, #0072b2)` : ink("--line");
      context.beginPath();
      context.arc(...point, 4, 0, 7);
      context.fill();
      const key = point.map(Math.round).join();
      taken.set(key, [...(taken.get(key) ?? []), row + 1]);
    });
    context.fillStyle = ink("--ink");
    for (const [key, numbers] of taken) context.fillText(numbers.length > 4 ? `${numbers.slice(0, 3).join(" ")} … ${numbers.at(-1)}` : numbers.join(" "), Number(key.split(",")[0]) + 6, Number(key.split(",")[1]) - 5);
    const colours = values ? `Blue is ${low}, red ${high} of ${this.by.value}. ` : "";
    this.note.textContent = `${colours}${arrows ? `Arrows: ${rivals[0].replaceAll("_", " ")} against its rival, at most ${largest.toPrecision(2)} µm. ` : ""}The line is the order. Drag to turn.`;
  }
}
