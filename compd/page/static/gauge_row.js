// One gauge in the table. Its cells stay in place and only changes are written, so that a button in it can
// be pressed and the focus is not lost.
import { ago, element, signed } from "./format.js";
import { drawSpark, rangeOf } from "./spark.js";

const UNITS = { degC: "°C", percent: "%", um: "µm" };
// Changes below this are drawn flat: mm for a length, else the quantity's unit.
const MIN_MM = 0.001;
const MIN_QUANTITY = 0.1;

// A quantity's name ends with its unit, as in temperature_room_degC.
export function quantity(name) {
  const words = name.split("_");
  const unit = words.pop();
  return { measures: words.join(" "), unit: UNITS[unit] ?? unit };
}

export function measured(wire) {
  if (wire.name) return quantity(wire.name);
  if (wire.distance) return { measures: `frame ${wire.distance}`, unit: "mm" };
  if (wire.kind === "scale") return { measures: `scale ${wire.link}`, unit: "mm" };
  return { measures: `${wire.kind} of link ${wire.link}${wire.role ? `, ${wire.role}` : ""}`, unit: "mm" };
}

function write(cell, text) {
  if (cell.textContent !== text) cell.textContent = text;
}

export class GaugeRow {
  // accept: gives the order; mayAccept: whether this browser can
  constructor(wire, { accept, mayAccept, select }) {
    Object.assign(this, { wire, mayAccept, ...measured(wire) });
    this.cells = Object.fromEntries(["value", "age", "quality", "change", "total", "recent"].map((name) => [name, element("span")]));
    this.bar = element("i");
    this.age = element("span", { class: "age" }, this.bar);
    this.spark = element("canvas", { class: "spark", role: "img", "aria-label": `${this.measures}, the last minute` });
    this.button = element("button", { type: "button", onclick: () => accept(wire.channel) }, "Accept …");
    this.quality = element("td", { class: "quality" }, this.cells.quality);
    const cell = (name, ...children) => element("td", { class: name }, ...children);
    this.row = element(
      "tr",
      { onclick: () => select(wire) },
      cell("name", this.measures, element("small", {}, wire.channel)),
      cell("number value", this.cells.value),
      cell("name", this.age, this.cells.age),
      cell("name", this.spark, this.cells.change),
      this.quality,
      cell("number", this.cells.total),
      cell("number", this.cells.recent),
    );
  }

  // reading : of a live event. faults : {total, recent} of this gauge, if known.
  show(reading, faults) {
    const digits = this.wire.kind === "quantity" ? 2 : 4;
    this.share = reading.fault ? Infinity : (reading.age_s ?? Infinity) / this.wire.stale_after_s;
    this.bad = Boolean(reading.fault);
    this.row.className = this.bad ? "bad" : reading.warning ? "warned" : "";
    this.age.classList.toggle("old", this.bad);
    this.bar.style.width = `${100 * Math.min(1, this.share)}%`;
    const waits = reading.fault === "distrusted" && this.mayAccept();
    if (waits && !this.button.isConnected) this.quality.prepend(this.button);
    if (!waits) this.button.remove();
    const warning = reading.warning ? `⚠ ${reading.warning}` : "";
    const fault = reading.fault ? `✕ ${reading.fault.replaceAll("_", " ")}${reading.detail ? `: ${reading.detail}` : ""}` : "";
    const quality = [fault, warning].filter(Boolean).join("; ") || "✓ ok";
    write(this.cells.value, reading.value === undefined ? "–" : `${this.wire.kind === "quantity" ? reading.value.toFixed(digits) : signed(reading.value, digits)} ${this.unit}`);
    write(this.cells.age, reading.age_s === undefined ? "" : ago(reading.age_s));
    write(this.cells.quality, quality);
    this.row.title = quality;
    write(this.cells.total, faults ? String(faults.total ?? 0) : "–");
    write(this.cells.recent, faults ? String(faults.recent ?? 0) : "–");
  }

  // The spark line, from its values at `times`.
  draw(times, values) {
    const isLength = this.unit === "mm";
    drawSpark(this.spark, times, values, isLength ? MIN_MM : MIN_QUANTITY);
    const range = rangeOf(values);
    const far = range ? range[1] - range[0] : NaN;
    write(this.cells.change, !Number.isFinite(far) ? "–" : isLength ? (far < 1 ? `${(far * 1000).toFixed(1)} µm` : `${far.toFixed(3)} mm`) : `${far.toFixed(2)} ${this.unit}`);
  }
}
