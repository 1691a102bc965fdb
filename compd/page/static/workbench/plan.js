// The next measurement: rows on which rival effects differ most, within limits; in words, in space and as files.
import { CommandLine } from "../command_line.js";
import { element, micro } from "../format.js";
import { EffectChoices } from "./effect_choices.js";
import { PlanPicture } from "./plan_picture.js";
import { textField } from "./problems.js";

const FILES = { plan: "Plan (CSV)", sa: "Targets for SpatialAnalyzer", csv: "Targets (CSV)", gcode: "G-code" };
const NAMES = { plan: "next.csv", sa: "targets.txt", csv: "targets.csv", gcode: "next.ngc" };

// A limit as displayed; an unchanged one keeps the recording's value with all digits.
const shown = (value) => (value === null ? "" : String(Number(value.toFixed(3))));

function typed(text) {
  const number = Number(text);
  return text && Number.isFinite(number) ? number : text;
}

// Two fields for one pair of numbers.
class PairField {
  constructor(label, [low, high]) {
    this.prefilled = [shown(low), shown(high)];
    this.low = textField(`${label} from`, { value: this.prefilled[0], inputmode: "decimal" });
    this.high = textField("to", { value: this.prefilled[1], inputmode: "decimal" });
    this.row = element("div", { class: "pair" }, this.low.row, this.high.row);
  }

  get changed() {
    return this.low.value !== this.prefilled[0] || this.high.value !== this.prefilled[1];
  }

  get value() {
    return [typed(this.low.value), typed(this.high.value)];
  }

  show(...texts) {
    this.low.show(...texts);
  }
}

export class Plan {
  constructor(place) {
    this.place = place;
    this.rivals = new EffectChoices("Rivals", 2, () => this.bench.attempt(() => this.offerLimits()));
    this.beside = new EffectChoices("Found as well, not in the model", 0, () => {});
    this.count = textField("Rows at most", { value: "40", id: "plan-rows", inputmode: "numeric" });
    this.limits = element("div", { class: "limits" });
    this.button = element("button", { type: "button", id: "plan-button", onclick: () => this.planOrCancel() }, "Plan");
    this.general = element("div", { class: "problem", role: "status" });
    this.picture = new PlanPicture();
    this.words = element("div", {});
    this.rows = element("div", { class: "rows", tabindex: 0, role: "region", "aria-label": "The planned rows" });
    this.feed = textField("Feed, mm/min (G-code)", { id: "plan-feed", inputmode: "decimal", oninput: () => this.showCommand() });
    this.dwell = textField("At rest, s (G-code)", { id: "plan-dwell", value: "3", inputmode: "decimal", oninput: () => this.showCommand() });
    this.files = element("div", { class: "row" });
    this.command = new CommandLine();
    this.shape = "plan";
    this.result = element("div", { class: "planned", hidden: true }, element("div", {}, this.words, this.files, this.feed.row, this.dwell.row, this.command.row, this.rows), this.picture.place);
    place.replaceChildren(
      element("h2", {}, "The next measurement ", element("small", {}, "rows on which rival effects differ most")),
      this.rivals.row, this.beside.row, element("div", {}, this.count.row, this.limits), element("div", { class: "row" }, this.button), this.general, this.result);
  }

  begin(bench) {
    this.bench = bench;
    this.result.hidden = true;
    this.showProblems([]);
    return this.offerLimits(true);
  }

  // The findings of a diagnosis: its first effect with rivals, and these; the others beside it.
  suggestFor({ steps }) {
    const open = steps.find(({ rivals }) => rivals.length);
    if (open) this.suggest([open.effect, ...open.rivals], steps.filter((step) => step !== open).map(({ effect }) => effect));
  }

  // effects: the rivals; beside: others that act on the recording
  suggest(effects, beside = []) {
    this.rivals.set(effects.filter((name) => this.rivals.effects.includes(name)));
    this.beside.set(beside.filter((name) => this.rivals.effects.includes(name)));
    this.bench.attempt(() => this.offerLimits());
  }

  // A plan requested by another panel.
  planFor(effects) {
    this.suggest(effects);
    this.place.scrollIntoView({ block: "start" });
    this.button.focus();
  }

  // The limits of an external model depend on the rivals.
  async offerLimits(anew = false) {
    const { bench } = this;
    if (!anew && !this.external) return;
    const answer = await bench.get(`plan?rivals=${encodeURIComponent(this.rivals.values.join())}`);
    this.external = "columns" in answer.limits;
    if (anew) {
      this.rivals.offer(answer.effects);
      this.beside.offer(answer.effects);
    }
    const { workspace, force, temperature, speed, columns = {} } = answer.limits;
    this.pairs = this.external ? new Map(Object.entries(columns).map(([name, pair]) => [`limit of ${name}`, new PairField(name, pair)])) : new Map([
      ...["x", "y", "z"].map((axis, k) => [axis, new PairField(`${axis}, mm,`, workspace[k])]),
      ["temperature", new PairField(`temperature, ${micro("degC")},`, temperature)],
    ]);
    this.numbers = this.external ? new Map() : new Map([["force", ["largest load, N", force]], ["speed", ["highest speed, mm/s", speed]]].map(([name, [label, value]]) => [name, { prefilled: shown(value), field: textField(label, { value: shown(value), inputmode: "decimal" }) }]));
    this.limits.replaceChildren(...[...this.pairs.values()].map(({ row }) => row), ...[...this.numbers.values()].map(({ field }) => field.row), element("p", { class: "note" }, "Limits are those of the recording until you change them."));
  }

  get order() {
    const keys = { rivals: this.rivals.values, beside: this.beside.values, rows: typed(this.count.value) };
    const axes = ["x", "y", "z"].map((axis) => this.pairs.get(axis));
    if (!this.external && axes.some((pair) => pair.changed)) keys.workspace = axes.map(({ value }) => value);
    for (const [name, pair] of this.pairs) if (name === "temperature" && pair.changed) keys.temperature = pair.value;
    if (this.external) keys.limits = Object.fromEntries([...this.pairs].filter(([, pair]) => pair.changed).map(([name, pair]) => [name.slice("limit of ".length), pair.value]));
    for (const [name, { prefilled, field }] of this.numbers) if (field.value !== prefilled) keys[name] = typed(field.value);
    return keys;
  }

  planOrCancel() {
    if (this.planning) this.planning.abort(new Error("The plan was cancelled."));
    else this.plan();
  }

  plan() {
    if (!this.bench) return;
    this.planning = new AbortController();
    this.button.textContent = "Cancel the plan";
    this.bench.attempt(async () => {
      const { key } = this.bench;
      const answer = await this.bench.post("plan", this.order, this.planning.signal);
      if (key !== this.bench.key) return; // another recording is open meanwhile
      this.showProblems(answer.problems ?? []);
      this.result.hidden = Boolean(answer.problems);
      if (!answer.problems) this.showPlan(answer);
    }).finally(() => {
      this.planning = null;
      this.button.textContent = "Plan";
    });
  }

  showProblems(problems) {
    const fields = new Map([["rivals", this.rivals], ["beside", this.beside], ["rows", this.count], ["workspace", this.pairs?.get("x")], ...(this.pairs ?? []), ...[...(this.numbers ?? [])].map(([name, { field }]) => [name, field])]);
    for (const field of new Set(fields.values())) field?.show();
    const texts = new Map();
    for (const { field, text } of problems) {
      const place = fields.get(field) ?? this.general;
      texts.set(place, [...(texts.get(place) ?? []), text]);
    }
    for (const [place, lines] of texts) if (place !== this.general) place.show(...lines);
    this.general.replaceChildren(...(texts.get(this.general) ?? []).map((text) => element("div", {}, text)));
  }

  showPlan(plan) {
    this.measurement = plan;
    const alike = plan.alike.map(([first, second]) => element("li", {}, `${first} and ${second} cannot be told apart within these limits`));
    this.words.replaceChildren(
      element("p", { class: "separation" }, element("b", {}, `${plan.before.toFixed(1)} → ${plan.separation.toFixed(1)}`), ` times the noise: ${plan.rivals.length > 1 ? "the difference of the rivals" : "the effect"} on this recording → with these rows as well. It is what is left over all rows when ${plan.rivals.length > 1 ? "one rival imitates the other" : "the model imitates it"} as well as it can; from ${plan.enough} on ${plan.rivals.length > 1 ? "they are told apart" : "it is seen"}.`),
      element("p", { id: "plan-summary" }, plan.summary), ...(alike.length ? [element("ul", {}, ...alike)] : []), element("p", {}, plan.instructions));
    this.rows.replaceChildren(element("table", { id: "plan-table" }, element("thead", {}, element("tr", {}, ...plan.columns.map((name) => element("th", {}, name)))), element("tbody", {}, ...plan.rows.map((row) => element("tr", {}, ...row.map((value) => element("td", { class: typeof value === "number" ? "number" : "" }, String(value))))))));
    this.files.replaceChildren(...Object.keys(plan.files).map((shape) => element("button", { type: "button", "data-format": shape, onclick: () => this.download(shape) }, `Download: ${FILES[shape]}`)));
    for (const field of [this.feed, this.dwell]) field.row.hidden = !("gcode" in plan.files);
    this.shape = "plan";
    this.showCommand();
    this.picture.show(plan);
  }

  showCommand() {
    if (!this.measurement) return;
    const { shape } = this;
    const motion = shape === "gcode" ? ` --feed ${this.feed.value || "FEED"} --dwell ${this.dwell.value || "3"}` : "";
    this.command.write(`${this.measurement.command}${shape === "plan" ? "" : ` --as ${shape}${motion}`} --out ${NAMES[shape]}`);
  }

  // The file, or the reason for its absence below the feed.
  download(shape) {
    this.shape = shape;
    this.showCommand();
    this.bench.attempt(async () => {
      this.feed.show();
      const motion = shape === "gcode" ? `?${new URLSearchParams({ feed: this.feed.value, dwell: this.dwell.value })}` : "";
      const response = await fetch(`workbench/${this.bench.key}/plan/${this.measurement.key}/${shape}${motion}`);
      if (!response.ok) return this.feed.show((await response.json()).reason);
      const link = element("a", { href: URL.createObjectURL(await response.blob()), download: this.measurement.files[shape] });
      link.click();
      URL.revokeObjectURL(link.href);
    });
  }
}
