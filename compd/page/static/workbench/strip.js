// The large numbers on top: the fall of the error from the machine without any effect to the model and to the trial,
// the error on rows left out, and the noise.
import { amounts, element, micro } from "../format.js";

// Most quantities listed as followed by the residual.
const MAX_TRENDS = 3;

export class Strip {
  // verdict: element for the comparison in words
  constructor(place, verdict) {
    this.verdict = verdict;
    this.bar = element("div", { class: "falling", role: "img" });
    this.numbers = element("div", { class: "errors" });
    place.replaceChildren(this.numbers, this.bar);
  }

  begin(bench) {
    this.bench = bench;
    this.left_out_rms = null;
    const { verdict, trends } = bench.summary;
    const sample = bench.summary.sample ? [element("p", { class: "note", id: "sample" }, bench.summary.sample)] : [];
    this.said = element("p", {}, verdict);
    this.verdict.replaceChildren(this.said, ...sample, ...(trends.length ? [element("p", { class: "note" }, `${trends.slice(0, MAX_TRENDS).join("; ")}.`)] : []));
    this.try();
  }

  // left_out_rms: error of the model on rows outside its fit
  // noise: the verdict in words where only noise is left
  measured({ left_out_rms, noise }) {
    this.left_out_rms = left_out_rms;
    if (noise) this.said.textContent = noise;
    this.try();
  }

  warned() {
    this.try();
  }

  try() {
    const { summary, tried_rms } = this.bench;
    if (!summary) return;
    const { rms, fall, floor, floor_known, unit, rows, used, numbers } = summary;
    const [start, now] = numbers.length ? fall.rms : [rms, rms];
    const lowest = tried_rms ?? now;
    const big = (value, text, name = "") => element("div", { class: name }, element("b", {}, value === null || value === undefined ? "–" : amounts([value], unit)), element("small", {}, text));
    const path = [start, ...(numbers.length ? [now] : []), ...(tried_rms === null ? [] : [tried_rms])];
    const text = amounts(path, unit);
    const states = ["without effects", "with the model", "tried"].filter((_, k) => [true, numbers.length > 0, tried_rms !== null][k]).join(" → ");
    this.numbers.replaceChildren(
      ...(path.length > 1 ? [element("div", { class: `fall${path.at(-1) > path[0] ? " worse" : ""}${this.bench.doubt ? " doubted" : ""}` }, element("b", {}, text), element("small", {}, `${states}${numbers.length && fall.differ ? `; ${fall.differ}` : ""}${this.bench.doubt ? `; ${this.bench.doubt}` : ""}${path.at(-1) > path[0] ? "; it makes the error larger" : ""}`))] : []),
      big(rms, `error now, ${used} of ${rows} rows`, "now"),
      big(this.left_out_rms, "on rows left out", "held"),
      big(tried_rms, tried_rms === null ? "nothing is tried" : "tried, not kept", "tried"),
      big(floor, floor_known ? "noise alone" : floor === null ? "noise not known" : "noise, estimated: none is declared"),
    );
    const part = (name, value) => {
      const made = element("i", { class: name });
      made.style.width = `${Math.min(100, (100 * value) / (start || 1))}%`;
      return made;
    };
    this.bar.setAttribute("aria-label", `The error as a bar: ${start.toFixed(2)} ${micro(unit)} without effects, ${rms.toFixed(2)} now${tried_rms === null ? "" : `, ${tried_rms.toFixed(2)} with the trial`}, noise ${floor?.toFixed(2) ?? "not known"}`);
    this.bar.classList.toggle("worse", lowest > start);
    this.bar.classList.toggle("doubted", Boolean(this.bench.doubt));
    this.bar.replaceChildren(part("left", lowest), part("noise", floor ?? 0));
  }
}
