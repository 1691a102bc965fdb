// Preview of a step of the model: the table old -> new, before it is written.
import { amounts, element, micro } from "../format.js";

const number = (value, digits = 4) => (value === null || value === undefined ? "–" : String(Number(value.toPrecision(digits))).replace("-", "−"));

export class Proposal {
  constructor() {
    this.place = element("div", { class: "proposal" });
  }

  clear() {
    this.shown = null;
    this.place.replaceChildren();
  }

  confirm(bench, step, warning) {
    if (warning) bench.doubted.add(`${bench.key} ${step.effect}`);
    return bench.change("step", step);
  }

  // Show the preview of a step; it can be made once the rows left out have told whether they support what is added.
  show(bench, step, verb) {
    this.shown = step;
    bench.attempt(async () => {
      this.place.replaceChildren(element("p", { class: "note" }, `fitting on ${bench.summary.used} rows …`));
      const doubted = step.kind === "add" ? bench.doubtOf(step.effect) : "";
      const outcome = await bench.post("step", { ...step, dry_run: true });
      if (this.shown !== step) return;
      const rows = outcome.numbers.map((entry) => element("tr", { class: entry.plausible ? "" : "bad" }, element("td", {}, `${entry.effect.replaceAll("_", " ")} ${entry.parameter}`), element("td", { class: "number" }, number(entry.was)), element("td", { class: "number" }, `${number(entry.value)}${entry.standard_error === null ? "" : ` ± ${number(entry.standard_error, 2)}`}`), element("td", {}, micro(entry.unit))));
      const doubt = element("div");
      const last = element("div", { class: "row" }, element("button", { type: "button", onclick: () => this.clear() }, "Leave it"));
      this.place.replaceChildren(
        element("div", { class: "consequence" },
          doubt,
          element("p", {}, element("b", { class: outcome.rms[1] > outcome.rms[0] ? "worse" : "" }, amounts(outcome.rms, outcome.unit)), `, floor ratio ${outcome.floor_ratio.map((value) => value?.toFixed(2) ?? "–").join(" → ")}. ${outcome.verdict}`),
          ...(outcome.differ ? [element("p", { class: "note" }, `Both errors are ${outcome.differ}.`)] : []),
          element("div", { class: "numbers", tabindex: 0, role: "region", "aria-label": "Numbers of the model" }, element("table", {}, element("thead", {}, element("tr", {}, ...["number", "was", "will be", "unit"].map((head) => element("th", {}, head)))), element("tbody", {}, ...rows))),
          ...(outcome.gone.length ? [element("p", {}, `Gone: ${outcome.gone.join(", ")}`)] : []),
          last),
      );
      this.place.scrollIntoView({ block: "nearest" });
      const asking = element("span", { class: "note", role: "status" }, "asking the rows left out whether they support it …");
      last.prepend(asking);
      const warning = await Promise.resolve(doubted).finally(() => asking.remove());
      if (this.shown !== step) return;
      if (warning) doubt.replaceChildren(element("p", { class: "warning", role: "alert" }, element("b", {}, "Not supported by these rows. "), warning));
      const confirm = element("button", { type: "button", id: "confirm", onclick: () => bench.attempt(() => this.confirm(bench, step, warning)) }, warning ? `${verb} all the same` : verb);
      last.prepend(confirm);
      if (!warning) confirm.focus({ preventScroll: true });
      this.place.scrollIntoView({ block: "nearest" });
    });
  }
}
