// The model files offered by the page. Running ones from elsewhere are shown, but cannot be chosen.
import { dateText, element } from "./format.js";

export class ModelList {
  constructor() {
    this.input = element("input", { type: "text", placeholder: "a name of the list", "aria-label": "Model file on the daemon's computer" });
    this.input.addEventListener("input", () => this.mark());
    this.body = element("tbody");
    this.where = element("p", { class: "note" });
    this.parts = [element("table", { class: "choose", "aria-label": "Model files" }, this.body), this.where, element("div", { class: "row" }, this.input)];
    this.rows = [];
  }

  get chosen() {
    return this.input.value.trim();
  }

  choose(name) {
    this.input.value = this.chosen === name ? "" : name;
    this.mark();
  }

  mark() {
    for (const { name, button } of this.rows) button.setAttribute("aria-pressed", String(name === this.chosen));
  }

  async list() {
    const listing = await (await fetch("models")).json();
    this.rows = listing.models.map(({ name, changed, offered, runs }) => {
      const button = element("button", { type: "button", onclick: () => this.choose(name) }, name);
      button.disabled = !offered;
      return { name, button, row: element("tr", {}, element("td", {}, button), element("td", {}, changed ? dateText(new Date(changed)) : offered ? "not there any more" : "in another directory"), element("td", {}, runs ? `● ${runs}` : "")) };
    });
    const beside = listing.directory ? `*model.yaml in ${listing.directory}` : "start the page with the configuration, or --models, to have a list";
    this.where.textContent = this.rows.length ? beside : `no model files: ${beside}`;
    this.body.replaceChildren(...this.rows.map(({ row }) => row));
    this.mark();
  }
}
