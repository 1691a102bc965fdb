// The large numbers on top: the error now and with the trial, on all rows and on rows left out, and the noise.
import { element, micro } from "../format.js";

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
    const { verdict, trends, rows, recorded_rows } = bench.summary;
    const sample = rows < recorded_rows ? [element("p", { class: "note", id: "sample" }, `Too long to be shown whole: everything here, also what is fitted, is of a sample of ${rows} of its ${recorded_rows} rows, spread evenly. The command lines go through all rows.`)] : [];
    this.verdict.replaceChildren(element("p", {}, verdict), ...sample, ...(trends.length ? [element("p", { class: "note" }, `${trends.slice(0, MAX_TRENDS).join("; ")}.`)] : []));
    this.try();
  }

  // left_out_rms: error of the model on rows outside its fit
  measured({ left_out_rms }) {
    this.left_out_rms = left_out_rms;
    this.try();
  }

  try() {
    const { summary, tried_rms } = this.bench;
    if (!summary) return;
    const { rms, floor, floor_known, unit, rows, used } = summary;
    const big = (value, text, name = "") => element("div", { class: name }, element("b", {}, value === null || value === undefined ? "–" : `${value.toFixed(2)} ${micro(unit)}`), element("small", {}, text));
    this.numbers.replaceChildren(
      big(rms, `error now, ${used} of ${rows} rows`, "now"),
      big(this.left_out_rms, "on rows left out", "held"),
      big(tried_rms, tried_rms === null ? "nothing is tried" : "tried, not kept", "tried"),
      big(floor, floor_known ? "noise alone" : floor === null ? "noise not known" : "noise, estimated: none is declared"),
    );
    const part = (name, value) => {
      const made = element("i", { class: name });
      made.style.width = `${Math.min(100, (100 * value) / (rms || 1))}%`;
      return made;
    };
    this.bar.setAttribute("aria-label", `The error as a bar: ${rms.toFixed(2)} ${unit} now${tried_rms === null ? "" : `, ${tried_rms.toFixed(2)} with the trial`}, noise ${floor?.toFixed(2) ?? "not known"}`);
    this.bar.replaceChildren(part("left", tried_rms ?? rms), part("noise", floor ?? 0));
  }
}
