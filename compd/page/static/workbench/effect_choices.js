// Some effects, chosen one after another: a select for each, and one more.
import { element } from "../format.js";

export class EffectChoices {
  // label: of each select; least: fewest selects; changed: called at another choice
  constructor(label, least, changed) {
    Object.assign(this, { label, least, changed, effects: [], chosen: [] });
    this.problem = element("div", { class: "problem", role: "status" });
    this.place = element("div", { class: "row" });
    this.row = element("div", {}, this.place, this.problem);
  }

  get values() {
    return this.chosen.filter(Boolean);
  }

  offer(effects) {
    this.effects = effects;
    this.set(this.chosen.filter((name) => effects.includes(name)));
  }

  set(names) {
    this.chosen = [...names];
    while (this.chosen.length < this.least) this.chosen.push("");
    this.draw();
  }

  draw() {
    const option = (value, chosen) => element("option", { value, selected: value === chosen }, value ? value.replaceAll("_", " ") : "none");
    const select = (chosen, k) => element("select", { "aria-label": `${this.label}, number ${k + 1}`, "data-choice": k, onchange: (event) => this.choose(k, event.target.value) }, ...["", ...this.effects].map((value) => option(value, chosen)));
    this.place.replaceChildren(element("span", {}, `${this.label}:`), ...this.chosen.map(select), element("button", { type: "button", "aria-label": `${this.label}: one more`, onclick: () => this.set([...this.chosen, ""]) }, "+"));
  }

  choose(k, name) {
    this.chosen[k] = name;
    this.changed();
  }

  show(...texts) {
    this.problem.replaceChildren(...texts.map((text) => element("div", {}, text)));
  }
}
