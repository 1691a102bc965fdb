// Rows that are chosen: their numbers, and a way to leave them out with a reason; and those that are left out.
import { CommandLine } from "../command_line.js";
import { element, micro, signed } from "../format.js";

const MAX_TOLD = 12;

export class Exclusions {
  constructor(place, selection) {
    Object.assign(this, { place, selection });
    this.reason = element("input", { type: "text", placeholder: "why, for example: the beam was cut", "aria-label": "Why these rows are left out", oninput: () => this.writeCommand() });
    this.command = new CommandLine();
    this.chosen = element("div", { id: "chosen" });
    this.left_out = element("div", { id: "left-out-rows" });
    place.replaceChildren(this.chosen, this.left_out);
    selection.listen(() => this.draw());
  }

  begin(bench) {
    this.bench = bench;
    this.reason.value = "";
    this.selection.set([]);
    this.showLeftOut();
  }

  get rows() {
    return [...this.selection.rows].sort((a, b) => a - b);
  }

  draw() {
    const { rows } = this;
    if (!rows.length) return this.chosen.replaceChildren();
    this.button = element("button", { type: "button", id: "exclude", onclick: () => this.exclude() }, `Leave ${rows.length === 1 ? "it" : "them"} out`);
    this.chosen.replaceChildren(
      element("p", {}, element("b", {}, rows.length === 1 ? `row ${rows[0]}` : `${rows.length} rows`), ` ${rows.length === 1 ? this.numbers(rows[0]) : rowsText(rows).slice(0, 120)}`),
      element("div", { class: "row" }, this.reason, this.button, element("button", { type: "button", onclick: () => this.selection.set([]) }, "Choose none (Esc)")),
      this.command.row,
    );
    this.writeCommand();
  }

  writeCommand() {
    this.button.disabled = !this.reason.value.trim();
    const quoted = `'${this.reason.value.trim().replaceAll("'", "'\\''")}'`;
    this.command.write(this.button.disabled ? "" : this.bench.summary.commands.exclude.replace("ROWS", rowsText(this.rows)).replace("REASON", () => quoted));
  }

  // Description of one row.
  numbers(row) {
    const { rows } = this.bench;
    const at = rows.row.indexOf(row);
    if (at < 0) return "";
    const m = rows.labels.length;
    const residual = rows.labels.map((label, k) => `${label} ${signed(rows.residual[at * m + k], 2)}`).join(", ");
    const place = [...rows.place_mm.slice(3 * at, 3 * at + 3)].map((value) => value.toFixed(1)).join(", ");
    return `at ${rows.time_s[at].toFixed(1)} s${Number.isFinite(rows.place_mm[3 * at]) ? `, tip ${place} mm` : ""}; residual ${residual} ${micro(rows.unit)}`;
  }

  focus() {
    if (this.selection.rows.size) this.reason.focus();
  }

  exclude() {
    this.bench.attempt(() => this.bench.change("exclusions", { rows: this.rows, reason: this.reason.value.trim() }));
  }

  showLeftOut() {
    const reasons = new Map();
    for (const [row, reason] of Object.entries(this.bench.summary.excluded)) reasons.set(reason, [...(reasons.get(reason) ?? []), Number(row)]);
    const others = Object.entries(this.bench.summary.left_out).filter(([reason]) => reason !== "excluded by a person");
    const entries = [...reasons].slice(0, MAX_TOLD).map(([reason, rows]) => {
      const command = new CommandLine(this.bench.summary.commands.include.replace("ROWS", rowsText(rows)));
      const back = element("button", { type: "button", class: "include", onclick: () => this.bench.attempt(() => this.bench.change("exclusions", { rows })) }, "Let them count again");
      return element("li", {}, `${rowsText(rows)}: ${reason} `, back, command.row);
    });
    const { faults } = this.bench.summary;
    const list = (title, items) => (items.length ? [element("p", {}, element("b", {}, title)), element("ul", {}, ...items)] : []);
    const told = others.map(([reason, count]) => element("li", {}, `${count}: ${reason}`));
    const wrong = faults.slice(0, MAX_TOLD).map((fault) => element("li", {}, fault));
    this.left_out.replaceChildren(...list("Rows that do not count", [...entries, ...told]), ...list("What is wrong with the data", wrong));
  }
}

// Rows in few words: 17-20,25.
function rowsText(rows) {
  const stretches = [];
  for (const row of rows) {
    const last = stretches.at(-1);
    if (last && row === last[1] + 1) last[1] = row;
    else stretches.push([row, row]);
  }
  return stretches.map(([first, last]) => (first === last ? `${first}` : `${first}-${last}`)).join(",");
}
