// Problems in words below their fields.
import { element } from "../format.js";

let count = 0;

// A control with its label, and a place for problems under it.
export class Field {
  constructor(label, input, note = "") {
    count += 1;
    this.input = input;
    this.problem = element("div", { class: "problem", id: `problem-${count}`, role: "status" });
    input.setAttribute("aria-describedby", this.problem.id);
    this.row = element("div", { class: "field" }, element("label", {}, element("span", {}, label), input), ...(note ? [element("small", {}, note)] : []), this.problem);
  }

  get value() {
    return this.input.value.trim();
  }

  // parts: texts or elements, one a line; none for a valid field
  show(...parts) {
    this.input.toggleAttribute("aria-invalid", parts.length > 0);
    this.problem.replaceChildren(...parts.map((part) => element("div", {}, part)));
  }
}

export function textField(label, { note = "", ...attributes } = {}) {
  return new Field(label, element("input", { type: "text", spellcheck: "false", autocomplete: "off", ...attributes }), note);
}
