// The residual of every drawn row in two states on the same axes and scale: without any effect and now, or now and with
// the trial.
import { element, ink, prepared } from "../format.js";
import { Turn } from "../orbit_control.js";
import { AgainstView } from "./against_view.js";
import { Hover } from "./hover.js";
import { Lasso } from "./lasso.js";
import { SpaceView, mapped } from "./space_view.js";
import { TargetView } from "./target_view.js";

const BEFORE = "#8c959f88";
const CHOSEN = "#e69f00";

export class Picture {
  // selection: of rows, shared by all views of rows
  constructor({ canvas, tabs, around, against, note }, selection) {
    Object.assign(this, { canvas, tabs, around, against, note, selection, rows: null, left: null, kind: "3D", views: {}, without: false, scales: new Map(), machine: "" });
    const draw = (this.redraw = () => this.draw());
    this.lasso = new Lasso(canvas, { wanted: (event) => event.button === 0 && (event.shiftKey || this.kind !== "3D"), draw, around: (contains) => this.pick(contains) });
    this.turn = new Turn(canvas, draw);
    this.hover = new Hover(canvas, () => this.rows && { rows: this.rows, residual: this.shown, marks: this.marks, used: (row) => this.used(row) });
    selection.listen(draw);
    canvas.addEventListener("keydown", (event) => this.key(event));
    against.addEventListener("change", () => against.value && this.choose(against.value));
  }

  // Kinds of picture follow from what was measured.
  begin(bench) {
    this.bench = bench;
    const { rows } = bench;
    this.rows = rows;
    this.left = this.every = null;
    const quantities = Object.keys(rows.shapes).filter((name) => name.startsWith("quantity "));
    const turned = new SpaceView((...sizes) => this.turn.projector(...sizes), "Drag to turn; with Shift, draw around rows to choose them.");
    const map = (name, across, up) => ({ [`map ${name}`]: new SpaceView(mapped(across, up), "Draw around rows to choose them.", name) });
    this.views = {
      ...(rows.labels.length === 3 ? { "3D": turned, ...map("xy", 0, 1), ...map("xz", 0, 2), ...map("yz", 1, 2), target: new TargetView() } : {}),
      time: new AgainstView("time_s", rows.time_title),
      ...Object.fromEntries(quantities.map((name) => [name.slice(9), new AgainstView(name, rows.quantity_titles[name])])),
    };
    this.tabbed = Object.keys(this.views).length - quantities.length;
    this.largest = this.scale(rows);
    this.choose(this.views[this.kind] ? this.kind : Object.keys(this.views)[0]);
  }

  // The largest residual that the pictures have room for: of the machine without any effect, on any of the recordings that
  // were opened. No step of the model and no other day changes it.
  scale(rows) {
    const { machine, recording, ledger } = this.bench.summary;
    const whose = `${machine} ${rows.unit} ${rows.labels.join()}`;
    if (whose !== this.machine) this.scales.clear();
    this.machine = whose;
    let largest = 0;
    rows.start.forEach((value, k) => {
      if (rows.start_used[Math.floor(k / rows.labels.length)]) largest = Math.max(largest, Math.abs(value));
    });
    this.scales.set(recording, largest);
    this.fallen = ledger.length > 0;
    return Math.max(...this.scales.values());
  }

  choose(kind) {
    this.kind = kind;
    const kinds = Object.keys(this.views);
    this.tabs.replaceChildren(...kinds.slice(0, this.tabbed).map((name) => element("button", { type: "button", role: "tab", "aria-selected": String(name === kind), onclick: () => this.choose(name) }, name)));
    this.around.replaceChildren(...this.machineSwitch(kind));
    this.against.replaceChildren(element("option", { value: "" }, "against …"), ...kinds.slice(this.tabbed).map((name) => element("option", { value: name, selected: name === kind }, name)));
    this.draw();
  }

  // Whether the machine stands around the arrows, which are larger without it.
  machineSwitch(kind) {
    const view = this.views[kind];
    if (kind !== "3D" || !this.rows.machine.length) return [];
    const change = ({ target }) => {
      view.machine = target.checked;
      this.draw();
    };
    return [element("label", { class: "machine-switch" }, element("input", { type: "checkbox", checked: view.machine, onchange: change }), " machine")];
  }

  // The next kind of picture, or the one before.
  step(by) {
    const kinds = Object.keys(this.views);
    if (kinds.length) this.choose(kinds[(kinds.indexOf(this.kind) + by + kinds.length) % kinds.length]);
  }

  try(left) {
    this.left = left;
    this.draw();
  }

  // Show only the state before the trial; and back.
  compare() {
    this.without = !this.without;
    this.draw();
  }

  used(row) {
    return this.rows.state[row] === 0;
  }

  get shown() {
    if (this.without && !this.left && this.fallen) return this.rows.start;
    return this.left && !this.without ? this.left : this.rows.residual;
  }

  draw() {
    const { context, width, height } = prepared(this.canvas);
    const { rows, left } = this;
    if (!rows) return;
    const view = this.views[this.kind];
    context.font = "12px system-ui";
    view.layout(rows, this.largest, width, height);
    view.frame(context, rows, width, height);
    this.marks = view.marks(rows, this.shown);
    const paint = (residual, colour, shown) => {
      context.fillStyle = colour;
      view.paint(context, rows, residual, residual === this.shown ? this.marks : view.marks(rows, residual), shown);
    };
    const used = (row) => this.used(row);
    if (left) paint(rows.residual, BEFORE, used);
    else if (this.fallen) paint(rows.start, BEFORE, (row) => rows.start_used[row] !== 0);
    if (left && !this.without) paint(left, ink("--bad"), used);
    else if (!left && !(this.fallen && this.without)) paint(rows.residual, ink("--line"), used);
    if (this.selection.rows.size) {
      context.lineWidth = 2;
      paint(this.shown, CHOSEN, (row) => this.used(row) && this.selection.rows.has(rows.row[row]));
      context.lineWidth = 1;
    }
    this.lasso.draw(context);
    const [before, after] = left ? ["now", "with the trial"] : ["without any effect", "with the model"];
    const states = this.without ? `Only ${before} (x).` : `Grey: ${before}; coloured: ${after}.`;
    this.note.textContent = left || this.fallen ? `${states} ${view.note}` : view.note;
  }

  // Rows whose mark is inside; all rows of a recording, even if thinned for the picture.
  pick(contains) {
    this.bench.attempt(async () => {
      const thinned = this.rows.row.length < this.bench.summary.rows;
      if (thinned) this.every ??= await this.bench.arrays("rows?all");
      const rows = thinned ? this.every : this.rows;
      const residual = thinned ? rows.residual : this.shown;
      const marks = this.views[this.kind].marks(rows, residual);
      const marks_per_row = marks.length / 2 / rows.row.length;
      const chosen = new Set();
      for (let k = 0; k < marks.length / 2; k++) {
        const row = Math.floor(k / marks_per_row);
        if (rows.state[row] === 0 && contains(marks[2 * k], marks[2 * k + 1])) chosen.add(rows.row[row]);
      }
      this.selection.set(chosen);
    });
  }

  // Rows by keyboard, in the order of the file: the next one, with Shift as well.
  key(event) {
    const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!by || !this.rows || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    const used = [...this.rows.row].filter((_, row) => this.used(row));
    const last = [...this.selection.rows].at(-1);
    const next = used[Math.max(0, Math.min(used.length - 1, used.indexOf(last) + by))];
    if (event.shiftKey) this.selection.add([next]);
    else this.selection.set([next]);
  }
}
