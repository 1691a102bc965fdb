// Preview of a step of the model: the table old -> new, before it is written.
import { element, micro } from "../format.js";

const number = (value, digits = 4) => (value === null || value === undefined ? "–" : String(Number(value.toPrecision(digits))).replace("-", "−"));

export class Proposal {
  constructor() {
    this.place = element("div", { class: "proposal" });
  }

  clear() {
    this.place.replaceChildren();
  }

  // Show the preview of a step, and make it on confirmation.
  show(bench, step, verb) {
    bench.attempt(async () => {
      this.place.replaceChildren(element("p", { class: "note" }, `fitting on ${bench.summary.used} rows, and asking the rows left out …`));
      const outcome = await bench.post("step", { ...step, dry_run: true });
      const rows = outcome.numbers.map((entry) => element("tr", { class: entry.plausible ? "" : "bad" }, element("td", {}, `${entry.effect.replaceAll("_", " ")} ${entry.parameter}`), element("td", { class: "number" }, number(entry.was)), element("td", { class: "number" }, `${number(entry.value)}${entry.standard_error === null ? "" : ` ± ${number(entry.standard_error, 2)}`}`), element("td", {}, micro(entry.unit))));
      const confirm = element("button", { type: "button", id: "confirm", onclick: () => bench.attempt(() => bench.change("step", step)) }, outcome.warning ? `${verb} all the same` : verb);
      this.place.replaceChildren(
        element("div", { class: "consequence" },
          ...(outcome.warning ? [element("p", { class: "warning", role: "alert" }, element("b", {}, "Not supported by these rows. "), outcome.warning)] : []),
          element("p", {}, element("b", {}, `${outcome.rms[0].toFixed(2)} → ${outcome.rms[1].toFixed(2)} ${micro(outcome.unit)}`), `, floor ratio ${outcome.floor_ratio.map((value) => value?.toFixed(2) ?? "–").join(" → ")}. ${outcome.verdict}`),
          ...(outcome.differ ? [element("p", { class: "note" }, `Both errors are ${outcome.differ}.`)] : []),
          element("table", {}, element("thead", {}, element("tr", {}, ...["number", "was", "will be", "unit"].map((head) => element("th", {}, head)))), element("tbody", {}, ...rows)),
          ...(outcome.gone.length ? [element("p", {}, `Gone: ${outcome.gone.join(", ")}`)] : []),
          element("div", { class: "row" }, confirm, element("button", { type: "button", onclick: () => this.clear() }, "Leave it"))),
      );
      if (outcome.warning) this.place.scrollIntoView({ block: "nearest" });
      else confirm.focus();
    });
  }
}
