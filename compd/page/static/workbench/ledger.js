// The model: its numbers, its steps as a staircase of the error, and the way back.
import { CommandLine } from "../command_line.js";
import { amounts, element, ink, micro, prepared } from "../format.js";
import { Proposal } from "./proposal.js";
import { stroke } from "./ticks.js";

// Two errors of the staircase that look the same (share of its height).
const SAME = 0.005;
const words = (effect) => effect.replaceAll("_", " ");

export class Ledger {
  constructor(place) {
    Object.assign(this, { place, redraw: () => {} });
  }

  undo() {
    if (!this.button.disabled) this.bench.attempt(() => this.bench.change("step", { kind: "undo" }));
  }

  begin(bench) {
    this.bench = bench;
    const { ledger, numbers, floor, unit, model, commands } = bench.summary;
    const canvas = element("canvas", { class: "staircase", role: "img", "aria-label": `The error after each step: ${ledger.map(({ after }) => after.toFixed(2)).join(", ") || "no step yet"}` });
    const proposal = new Proposal();
    const button = (text, act, id) => element("button", { type: "button", id, onclick: act }, text);
    this.button = button("Undo the last step (u)", () => this.undo(), "undo");
    this.button.disabled = !ledger.some((step) => step.kind !== "undo" && !step.undone);
    const value = (entry) => `${Number(entry.value.toPrecision(4))}${entry.standard_error === null ? "" : ` ± ${Number(entry.standard_error.toPrecision(2))}`} ${micro(entry.unit)}`;
    const effects = [...new Set(numbers.map(({ effect }) => effect))];
    const removals = effects.map((effect) => button(`Remove ${words(effect)} …`, () => proposal.show(bench, { kind: "remove", effect }, "Remove it")));
    const fit = effects.length ? [button("Fit all again …", () => proposal.show(bench, { kind: "fit" }, "Keep this fit"), "fit-all")] : [];
    this.place.replaceChildren(
      element("h2", {}, "Model ", element("small", {}, model)),
      canvas,
      table(ledger.map((step) => [`${step.kind}${step.undone ? ", undone" : ""}`, words(step.effect), amounts([step.before, step.after], step.unit)]), ledger.map(({ before, after }) => after > before)),
      table(numbers.map((entry) => [`${words(entry.effect)} ${entry.parameter}`, value(entry)]), numbers.map(({ plausible }) => !plausible)),
      ...(numbers.length ? [] : [element("p", { class: "note" }, "No effect yet.")]),
      element("div", { class: "row" }, this.button, ...fit, ...removals),
      proposal.place,
      ...[commands.undo, ...(effects.length ? [commands.fit, commands.remove] : []), ...(ledger.length ? [commands.ledger] : [])].map((command) => new CommandLine(command).row),
    );
    canvas.hidden = !ledger.length;
    this.redraw = () => this.draw(canvas, ledger, floor, unit);
    new ResizeObserver(this.redraw).observe(canvas);
  }

  draw(canvas, ledger, floor, unit) {
    const { context, width, height } = prepared(canvas);
    if (!ledger.length) return;
    const top = Math.max(...ledger.flatMap(({ before, after }) => [before, after])) * 1.1;
    const [x, y] = [(k) => 8 + (k * (width - 16)) / (ledger.length + 1), (value) => height - 16 - (value / top) * (height - 30)];
    context.lineWidth = 2;
    // each step from its own error before: of another recording, or of other rows, that is not the last one's after
    stroke(context, "--line", x(0), y(ledger[0].before), x(1), y(ledger[0].before));
    ledger.forEach(({ before, after }, k) => {
      const colour = after > before ? "--bad" : "--line";
      stroke(context, colour, x(k + 1), y(before), x(k + 1), y(after));
      stroke(context, colour, x(k + 1), y(after), x(k + 2), y(after));
      const last = k ? ledger[k - 1].after : before;
      if (Math.abs(last - before) < SAME * top) return;
      context.setLineDash([2, 3]);
      stroke(context, "--soft", x(k + 1), y(last), x(k + 1), y(before));
      context.setLineDash([]);
    });
    context.font = "11px system-ui";
    context.fillStyle = ink("--soft");
    if (floor !== null) {
      context.setLineDash([4, 4]);
      stroke(context, "--soft", 8, y(floor), width - 8, y(floor));
      context.setLineDash([]);
      context.fillText(`noise ${amounts([floor], unit)}`, 10, y(floor) - 3);
    }
    ledger.forEach((step, k) => context.fillText(`${step.kind === "add" ? "+" : step.kind === "remove" ? "−" : step.kind} ${words(step.effect)}`, x(k + 1) + 3, Math.max(11, y(step.after) - 4)));
  }
}

// The last cell of each row is a number; bad: rows with a number outside its plausible range.
function table(rows, bad = []) {
  const cells = (row) => row.map((text, k) => element("td", { class: k === row.length - 1 ? "number" : "" }, text));
  return element("table", {}, element("tbody", {}, ...rows.map((row, k) => element("tr", { class: bad[k] ? "bad" : "" }, ...cells(row)))));
}
