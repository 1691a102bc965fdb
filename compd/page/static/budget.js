// Displacement of the tip: one bar for each axis, stacked by cause, with the bound of the tip's error as a whisker where
// it is no longer than the bar, and the shadow model's sum as an outline.
import { keptScale, outline, stack, whisker } from "./bar.js";
import { causeColour, element, isKnown, lengthText, signedLength } from "./format.js";

export class Budget {
  constructor(place) {
    this.place = place;
    this.scale_um = 1;
  }

  begin(machine) {
    // A cause without gauges has no place in the legend: it stays 0.
    const kinds = new Set(machine.wiring.map(({ kind }) => kind));
    this.absent = [["joints", "joint"], ["frame", "frame"]].filter(([, kind]) => !kinds.has(kind)).map(([cause]) => cause);
    this.rows = ["x", "y", "z"].map((axis) => {
      const bar = element("div", { class: "bar" });
      const number = element("b");
      const shadow = element("small");
      return { bar, number, shadow, row: element("div", { class: "axis" }, element("b", {}, axis), bar, element("div", { class: "number" }, number, shadow)) };
    });
    this.legend = element("div", { class: "legend" });
    this.scale = element("p", { class: "note" });
    this.key = null;
    this.place.replaceChildren(...this.rows.map(({ row }) => row), this.legend, this.scale);
  }

  show({ budget, shadow_budget, setpoint }) {
    const causes = budget ? Object.keys(budget) : [];
    const vectors = causes.map((cause) => budget[cause]);
    const ends = [0, 1, 2].map((axis) => Math.max(vectors.reduce((sum, vector) => sum + Math.abs(vector[axis]), 0), Math.abs(shadow_budget?.[axis] ?? 0)));
    this.scale_um = keptScale(this.scale_um, Math.max(...ends));
    const u_tip_um = setpoint.u_tip_um;
    const bounded = isKnown(u_tip_um) && u_tip_um <= this.scale_um;
    this.drawLegend(causes, bounded, setpoint);
    this.scale.textContent = vectors.length ? `bars end at ±${lengthText(this.scale_um)}` : "";
    this.rows.forEach(({ bar, number, shadow }, axis) => {
      shadow.textContent = vectors.length && shadow_budget ? `shadow ${signedLength(shadow_budget[axis])}` : "";
      if (!vectors.length) {
        bar.replaceChildren();
        number.textContent = "–";
        return;
      }
      const parts = vectors.map((vector) => vector[axis]);
      const sum = parts.reduce((a, b) => a + b, 0);
      stack(bar, parts, this.scale_um);
      if (bounded) whisker(bar, sum, u_tip_um, this.scale_um);
      if (shadow_budget) outline(bar, shadow_budget[axis], this.scale_um);
      number.textContent = signedLength(sum);
    });
  }

  drawLegend(causes, bounded, setpoint) {
    const { shadow } = setpoint;
    const why = shadow?.reason ?? "";
    const key = [...causes, bounded, Boolean(shadow), why].join();
    if (key === this.key) return;
    this.key = key;
    const patch = (name, text, colour) => {
      const sample = element("i", { class: name });
      if (colour) sample.style.background = colour;
      return element("span", {}, sample, text);
    };
    const entries = causes.flatMap((cause, k) => (this.absent.includes(cause) ? [] : [patch("", cause.replaceAll("_", " "), causeColour(k))]));
    if (causes.length) entries.push(patch("sum", "sum"));
    if (bounded) entries.push(patch("whisker", "bound of the tip's error, 95 %"));
    if (shadow) entries.push(patch("shadow", why ? `shadow model, not applied: ${why}` : "shadow model, not applied"));
    this.legend.replaceChildren(...entries);
  }
}
