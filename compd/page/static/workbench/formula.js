// An effect of one's own: a formula checked at every key, tried once valid, and saved in a file.
import { CommandLine } from "../command_line.js";
import { element } from "../format.js";
import { ParameterRow } from "./parameter_row.js";
import { Field, textField } from "./problems.js";

const QUIET_MS = 150;
const FIRST_ID = "my_effect";
const IN_FORM = ["id", "port", "physics", "formula", "axis", "gives", "parameters"];

export class Formula {
  // card: where the effect is tried; effects: the list in which it has its place
  constructor(place, card, effects) {
    Object.assign(this, { place, card, effects, asked: 0, saving: false, timer: 0, rows: [], formulas: {}, rest: {}, offer: null });
    const changed = () => this.changed();
    this.saved = new Field("Saved effects", element("select", { id: "saved-effects", onchange: () => this.load(this.saved.input.value) }));
    this.id = textField("Id", { id: "formula-id", value: FIRST_ID, oninput: changed });
    this.physics = textField("Physics, in a sentence", { id: "formula-physics", oninput: changed });
    this.physics.row.classList.add("wide");
    this.port = new Field("Port, where it acts", element("select", { id: "formula-port", onchange: () => this.choosePort(this.port.input.value) }));
    this.gives = new Field("Its value is in", element("select", { onchange: changed }, element("option", { value: "um" }, "µm"), element("option", { value: "mm" }, "mm")));
    this.formulaPlace = element("div", {});
    this.rowsPlace = element("div", {});
    this.names = element("div", {});
    this.general = element("div", { class: "problem", role: "status" });
    this.confirm = element("div", {});
    this.button = element("button", { type: "button", id: "save-effect", onclick: () => this.save(false) }, "Save");
    this.remove = element("button", { type: "button", id: "delete-effect", onclick: () => this.askDelete() }, "Delete …");
    this.add = element("button", { type: "button", onclick: () => this.addRow("", {}) }, "Add a parameter");
    this.commands = [new CommandLine(), new CommandLine()];
  }

  async begin(bench) {
    this.bench = bench;
    const offer = await bench.get("formula");
    const first = !this.offer;
    this.offer = offer;
    this.draw();
    this.choosePort(this.port.input.value || "link", this.texts(), false);
    if (!first) await this.check(this.saving);
    this.saving = false;
  }

  draw() {
    const { offer, bench } = this;
    const option = (value, label, selected) => element("option", { value, selected }, label);
    const port = this.port.input.value || "link";
    this.port.input.replaceChildren(...offer.ports.map((each) => option(each.port, each.port.replaceAll("_", " "), each.port === port)));
    this.saved.input.replaceChildren(option("", "a new one"), ...offer.saved.map(({ id }) => option(id, id.replaceAll("_", " "), id === this.loaded)));
    this.general.replaceChildren(...offer.problems.map((problem) => element("div", {}, problem)));
    this.place.replaceChildren(
      element("h2", {}, "An effect of your own ", element("small", {}, `a formula, tried as you type; kept in ${offer.file}`)),
      element("div", { class: "formula" },
        element("div", {}, this.saved.row, this.id.row, this.port.row, this.gives.row, this.physics.row, this.formulaPlace, this.rowsPlace, element("div", { class: "row" }, this.add, this.button, this.remove), this.confirm, this.general, ...this.commands.map(({ row }) => row)),
        this.names));
    this.showCommands();
    this.button.title = bench.summary.model;
  }

  showCommands() {
    const { show, add } = this.bench.summary.commands;
    const known = this.offer.saved.some(({ id }) => id === this.id.value);
    const named = known ? quoted(`${this.offer.file}:${this.id.value}`) : "";
    this.remove.disabled = !known;
    this.commands[0].write(known ? show.replace("EFFECT", () => named) : "");
    this.commands[1].write(known ? add.replace("EFFECT", () => named) : "");
  }

  // texts: the formula by axis. check: whether to check it at once
  choosePort(port, texts = this.texts(), check = true) {
    const chosen = this.offer.ports.find((each) => each.port === port) ?? this.offer.ports[0];
    this.port.input.value = chosen.port;
    const only = Object.values(texts)[0] ?? "";
    this.formulas = Object.fromEntries((chosen.axes.length ? chosen.axes : [""]).map((axis, k) => {
      const value = texts[axis] ?? (k ? "" : only);
      const field = textField(axis ? `Formula along ${axis}` : "Formula", { class: "code", id: `formula-text${axis && `-${axis}`}`, maxlength: this.offer.longest + 1, value, oninput: () => this.changed(), onfocus: () => (this.at = field.input) });
      field.row.classList.add("wide");
      return [axis, field];
    }));
    this.at = Object.values(this.formulas)[0].input;
    this.formulaPlace.replaceChildren(element("p", { class: "note" }, `${chosen.port.replaceAll("_", " ")}: ${chosen.meaning}`), ...Object.values(this.formulas).map(({ row }) => row));
    const named = ({ name, meaning }) => element("button", { type: "button", title: meaning, onclick: () => this.insert(name) }, name);
    this.names.replaceChildren(
      element("h3", {}, "Columns of this recording that a formula here may name"), element("div", { class: "names", id: "columns" }, ...chosen.columns.map(named)),
      element("h3", {}, "Functions and numbers"), element("div", { class: "names" }, ...this.offer.functions.map(named)),
      element("p", { class: "note" }, "Every other name is a parameter. One to which the formula is proportional is fitted, any other is searched within its range."));
    for (const row of this.rows) row.offerLinks(chosen.per_link);
    this.perLink = chosen.per_link;
    if (check) this.changed();
  }

  insert(name) {
    const { at } = this;
    at.setRangeText(name, at.selectionStart, at.selectionEnd, "end");
    at.focus();
    this.changed();
  }

  // The formulas that are written, by axis; "" for a port without direction.
  texts() {
    return Object.fromEntries(Object.entries(this.formulas).map(([axis, field]) => [axis, field.value]).filter(([, text]) => text));
  }

  get declaration() {
    const texts = this.texts();
    const formula = "" in this.formulas ? texts[""] : texts;
    return {
      id: this.id.value, port: this.port.input.value, ...(this.physics.value ? { physics: this.physics.value } : {}), formula,
      ...(this.gives.input.value === "mm" ? { gives: "mm" } : {}), parameters: Object.fromEntries(this.rows.filter(({ name }) => name).map((row) => [row.name, row.declaration])), ...this.rest,
    };
  }

  addRow(name, declaration) {
    const row = new ParameterRow(name, declaration, () => this.changed(), (gone) => this.dropRow(gone));
    row.offerLinks(this.perLink);
    this.rows.push(row);
    this.rowsPlace.append(row.row);
    if (!name) row.fields.name.input.focus();
  }

  dropRow(row) {
    this.rows = this.rows.filter((other) => other !== row);
    row.row.remove();
    this.changed();
  }

  // One of the file, or a new one.
  load(id) {
    this.loaded = id;
    this.fill(this.offer.saved.find((each) => each.id === id) ?? { id: FIRST_ID, port: "link", formula: "", parameters: {} });
  }

  // A declaration from elsewhere, such as the proposal of a diagnosis; it is tried at once.
  edit(declaration) {
    this.loaded = "";
    this.fill(declaration);
    this.place.scrollIntoView({ block: "nearest" });
    this.changed();
  }

  fill(declaration) {
    this.id.input.value = declaration.id;
    this.physics.input.value = declaration.physics ?? "";
    this.gives.input.value = declaration.gives ?? "um";
    this.rest = Object.fromEntries(Object.entries(declaration).filter(([key]) => !IN_FORM.includes(key)));
    for (const row of this.rows) row.row.remove();
    this.rows = [];
    for (const [name, parameter] of Object.entries(declaration.parameters ?? {})) this.addRow(name, parameter);
    const { formula = "", axis = "" } = declaration;
    this.choosePort(declaration.port, typeof formula === "string" ? { [axis]: formula } : formula);
  }

  changed() {
    clearTimeout(this.timer);
    this.showCommands();
    this.timer = setTimeout(() => this.bench.attempt(() => this.check()), QUIET_MS);
  }

  // trying: whether the effect goes into the card once valid
  async check(trying = true) {
    this.asked += 1;
    const { asked } = this;
    if (!Object.keys(this.texts()).length) {
      this.show([]);
      this.effects.write(null);
      return;
    }
    const answer = await this.bench.post("formula", { declaration: this.declaration });
    if (asked !== this.asked) return; // an outdated answer
    if (this.takeNames(answer.missing)) return this.check(trying);
    this.show(answer.problems);
    this.right = answer.right;
    this.effects.write(answer.draft ?? null);
    if (trying && answer.draft && answer.draft.effect !== this.card.card?.asked) await this.choose(answer.draft.effect);
  }

  async choose(name) {
    await this.card.choose(name);
    if (this.card.card?.asked === name) this.card.fit();
  }

  // A row for each name that is no column; unfilled rows vanish with their names.
  takeNames(missing) {
    const words = Object.values(this.texts()).join(" ").match(/[A-Za-z]\w*/g) ?? [];
    for (const row of this.rows) {
      if (row.name && row.blank && !words.includes(row.name) && document.activeElement !== row.fields.name.input) {
        this.rows = this.rows.filter((other) => other !== row);
        row.row.remove();
      }
    }
    for (const name of missing) this.addRow(name, {});
    return missing.length > 0;
  }

  show(problems) {
    const lines = new Map();
    const put = (field, part) => lines.set(field, [...(lines.get(field) ?? []), part]);
    for (const problem of problems) {
      const field = this.fieldOf(problem);
      put(field, problem.text);
      if (problem.character && field !== this.general) put(field, marked(field.value, problem.character));
    }
    const names = this.rows.map(({ name }) => name);
    for (const row of this.rows) if (names.indexOf(row.name) !== this.rows.indexOf(row)) put(row.fields.name, "this name is there twice");
    const fields = [this.id, this.physics, this.port, this.gives, ...Object.values(this.formulas), ...this.rows.flatMap((row) => Object.values(row.fields))];
    for (const field of fields) field.show(...(lines.get(field) ?? []));
    this.general.replaceChildren(...[...this.offer.problems, ...(lines.get(this.general) ?? [])].map((text) => element("div", {}, text)));
  }

  fieldOf({ field, axis, parameter, part }) {
    if (field === "formula" || field === "axis") return this.formulas[axis] ?? Object.values(this.formulas)[0];
    const row = this.rows.find(({ name }) => name === parameter);
    if (field === "parameters" && row) return row.fields[{ plausible: "low", "": "low" }[part] ?? part] ?? row.fields.name;
    return { id: this.id, physics: this.physics, port: this.port, gives: this.gives }[field] ?? this.general;
  }

  save(replace) {
    const { declaration } = this;
    this.confirm.replaceChildren();
    if (!replace && this.offer.saved.some(({ id }) => id === declaration.id)) return this.ask(`${declaration.id} is in the file already.`, "Replace it", () => this.save(true));
    this.bench.attempt(async () => {
      const answer = await this.bench.post("own", { declaration, replace });
      Object.assign(this, { loaded: declaration.id, saving: true });
      await this.bench.show(answer);
    });
  }

  askDelete() {
    const id = this.id.value;
    this.ask(`${id} is taken out of ${this.offer.file}. Models that have it keep it.`, "Delete it", () => this.bench.attempt(async () => {
      this.loaded = "";
      await this.bench.show(await this.bench.post("own", { delete: id }));
    }));
  }

  // The consequence, and the button for it.
  ask(text, label, act) {
    const leave = () => this.confirm.replaceChildren();
    this.confirm.replaceChildren(element("div", { class: "consequence" }, element("p", {}, text), element("div", { class: "row" }, element("button", { type: "button", id: "confirm-own", onclick: () => (leave(), act()) }, label), element("button", { type: "button", onclick: leave }, "Leave it"))));
  }
}

// The formula with its first wrong character marked.
function marked(text, character) {
  const at = Math.min(character - 1, text.length);
  return element("code", {}, text.slice(0, at), element("mark", {}, text[at] ?? " "), text.slice(at + 1));
}

// A word quoted for a shell.
function quoted(word) {
  return /^[\w@%+=:,./-]+$/.test(word) ? word : `'${word.replaceAll("'", "'\"'\"'")}'`;
}
