// Labelled fields whose values are choices of the wizard; the first option of a list is the detected default.
import { element } from "../format.js";

class Field {
  constructor(wizard, key, label, control) {
    Object.assign(this, { wizard, key, control });
    control.id = `choice-${key}`;
    this.label = element("label", {}, label, control);
    control.addEventListener("change", () => wizard.change({ [key]: this.value() }));
  }

  value() {
    return this.control.value.trim() || null;
  }

  // Hidden, and not chosen, if it contradicts the other choices.
  offer(offered) {
    this.label.hidden = !offered;
    if (offered || this.wizard.choices[this.key] == null) return;
    this.clear();
    this.wizard.change({ [this.key]: null });
  }

  clear() {
    this.control.value = "";
  }
}

export class Choice extends Field {
  // options: of [value, text]
  constructor(wizard, key, label, options = []) {
    super(wizard, key, label, element("select"));
    this.options(options, "detected");
  }

  options(options, automatic) {
    const all = [["", automatic], ...options];
    const text = JSON.stringify(all);
    if (text !== this.shown) this.control.replaceChildren(...all.map(([value, name]) => element("option", { value }, name)));
    this.shown = text;
    this.control.value = this.wizard.choices[this.key] ?? "";
  }

  // The text without a choice.
  automatic(text) {
    this.options(JSON.parse(this.shown).slice(1), text);
  }
}

export class Quantity extends Field {
  constructor(wizard, key, label, placeholder = "", step = "any") {
    super(wizard, key, label, element("input", { type: "number", step, placeholder }));
  }

  value() {
    return this.control.value === "" ? null : Number(this.control.value);
  }
}

export class Text extends Field {
  constructor(wizard, key, label, placeholder = "") {
    super(wizard, key, label, element("input", { type: "text", placeholder, spellcheck: false }));
  }
}

export class Check extends Field {
  constructor(wizard, key, label) {
    super(wizard, key, label, element("input", { type: "checkbox" }));
    this.label.className = "check";
    this.label.prepend(this.control);
  }

  value() {
    return this.control.checked || null;
  }

  clear() {
    this.control.checked = false;
  }
}
