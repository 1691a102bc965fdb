// A table's first rows, the role of each column, what was taken for what, and what is wrong with it.
import { element } from "../format.js";

export class Columns {
  // key: of the choice with the roles. prefix: of the ids of their lists.
  constructor(wizard, { problems, table, taken, note }, key, prefix) {
    Object.assign(this, { wizard, problems, table, taken, note, key, prefix });
  }

  showWhole(table, none) {
    this.note.textContent = !table ? none : table.points ? `${table.points} rows are read; the first ${table.rows.length} of the file are shown` : "not read yet: answer the questions";
    this.problems.replaceChildren(...(table?.problems ?? []).map((problem) => element("p", { class: "problem" }, problem)));
    this.showTaken(table);
    this.showTable(table);
  }

  showTaken(table) {
    const left = Object.entries(table?.left_out ?? {}).map(([reason, count]) => [`${count} rows not used`, reason]);
    this.taken.replaceChildren(...[...Object.entries(table?.assumed ?? {}), ...left].flatMap(([name, text]) => [element("dt", {}, name), element("dd", {}, text)]));
  }

  showTable(table) {
    const focused = this.table.contains(document.activeElement) ? document.activeElement.id : "";
    if (!table?.rows.length) return this.table.replaceChildren();
    const roles = this.columns(table);
    const above = roles.map((role, k) => element("th", { scope: "col" }, this.roleOf(role, k)));
    const names = table.header.map((name) => element("th", { scope: "col" }, name));
    const unused = (k) => (roles[k] === "-" ? "unused" : "");
    const rows = table.rows.map((row, i) => element("tr", {}, element("td", { class: "line" }, String(table.line[i])), ...row.map((cell, k) => element("td", { class: unused(k) }, cell))));
    const head = [above, names].filter((cells) => cells.length).map((cells, i) => element("tr", {}, element("th", { class: "line" }, i || !above.length ? "line" : "meaning"), ...cells));
    this.table.replaceChildren(element("table", {}, element("thead", {}, ...head), element("tbody", {}, ...rows)));
    if (focused) document.getElementById(focused)?.focus();
  }

  // The chosen or guessed role of each column.
  columns(table) {
    const chosen = this.wizard.choices[this.key];
    return chosen?.length === table.roles.length ? chosen : table.roles;
  }

  roleList(k, options, chosen) {
    const select = element("select", { id: `${this.prefix}role-${k}`, "aria-label": `Meaning of column ${k + 1}` }, ...options.map(([value, text]) => element("option", { value, selected: value === chosen }, text)));
    select.addEventListener("change", () => this.change(k, select.value));
    return select;
  }
}
