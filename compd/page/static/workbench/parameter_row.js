// One parameter of a formula: name, unit, plausible range and its source.
import { element } from "../format.js";
import { Field, textField } from "./problems.js";

// A number as typed; other text is sent unchanged, and the server reports it.
function typed(text) {
  if (!text) return null;
  const number = Number(text);
  return Number.isFinite(number) ? number : text;
}

export class ParameterRow {
  // changed: called at every key; removed: called with the row
  constructor(name, { unit = "", plausible = ["", ""], source = "", per = "machine" } = {}, changed, removed) {
    this.fields = {
      name: textField("parameter", { value: name }),
      unit: textField("unit", { value: unit }),
      low: textField("plausible from", { value: plausible[0] ?? "", inputmode: "decimal" }),
      high: textField("to", { value: plausible[1] ?? "", inputmode: "decimal" }),
      source: textField("where that range comes from", { value: source }),
      per: new Field("one for", element("select", {}, ...["machine", "link"].map((value) => element("option", { value, selected: value === per }, `the ${value}`.replace("the link", "each link"))))),
    };
    this.fields.source.row.classList.add("source");
    for (const { input } of Object.values(this.fields)) input.addEventListener("input", changed);
    const remove = element("button", { type: "button", "aria-label": `Remove the parameter ${name}`, onclick: () => removed(this) }, "Remove");
    this.row = element("div", { class: "parameter" }, ...Object.values(this.fields).map(({ row }) => row), remove);
  }

  get name() {
    return this.fields.name.value;
  }

  // Whether all fields but the name are empty.
  get blank() {
    return ["unit", "low", "high", "source"].every((part) => !this.fields[part].value);
  }

  get declaration() {
    const { unit, low, high, source, per } = this.fields;
    return { unit: unit.value, plausible: [typed(low.value), typed(high.value)], source: source.value, ...(per.value === "link" ? { per: "link" } : {}) };
  }

  offerLinks(links) {
    this.fields.per.row.hidden = !links && this.fields.per.value === "machine";
  }
}
