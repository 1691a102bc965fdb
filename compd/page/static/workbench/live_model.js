// The running machine: this model as its shadow, then adopted; its effect there beside the recording's error.
import { Age } from "../age.js";
import { describe } from "../banner.js";
import { scaleFor } from "../bar.js";
import { amounts, causeColour, element, lengthText } from "../format.js";
import { listen } from "../live_events.js";
import { firstStep } from "../order_names.js";
import { Orders } from "../orders.js";

const LOOK_EVERY_MS = 500;
const [RECORDED, BEYOND, APPLIED] = [0, 1, 2].map(causeColour);
const MEANING = "Recording: reference against model, rms per coordinate. Live: what models move the tip by, rms per coordinate over the last minute or since the models have changed. There is no live reference: this is what the shadow would take out beyond the applied model if it is right, and no measured error.";

const plain = (name) => name.replaceAll("_", " ");
const fileName = (path) => path.split("/").at(-1);
const perCoordinate = (axes_um) => Math.hypot(...axes_um) / Math.sqrt(axes_um.length);

function write(place, text) {
  if (place.textContent !== text) place.textContent = text;
}

export class LiveModel {
  constructor(place) {
    Object.assign(this, { place, bench: null, age: new Age(), page: { role: "view", armed_until: 0, machine: null, live: null, slow: null } });
    this.orders = new Orders(this.page, "confirm-order");
    const button = (text, id, order) => element("button", { type: "button", id, onclick: order }, text);
    const ask = (name, subject) => this.bench.attempt(() => this.orders.ask(name, subject));
    this.run = button("Run this model as a shadow …", "live-shadow", () => ask("shadow", fileName(this.bench.summary.model)));
    this.adopt = button("Adopt it …", "live-adopt", () => ask("adopt", this.bench.summary.model_hash));
    this.state = element("p", { id: "live-state", "aria-live": "polite" });
    this.models = element("p", { id: "live-models" });
    this.why = element("p", { class: "note", id: "live-why" });
    this.offered = element("div", {}, element("div", { class: "row" }, this.orders.arm, this.run, this.adopt, button(firstStep("shadow", ""), "live-no-shadow", () => ask("shadow", "")), button(firstStep("no-model"), "live-no-model", () => ask("no-model", ""))), this.why, this.orders.consequence, this.orders.answer);
    this.bars = element("div", { id: "live-bars" });
    place.replaceChildren(element("h2", {}, "Machine ", element("small", {}, "the model on the machine that runs")), element("div", { class: "halves" }, element("div", {}, this.state, this.models, this.offered), this.bars));
    listen(this.page, this.age, { machine: (machine) => (this.page.machine = machine), live: () => {}, slow: () => this.hear() });
    setInterval(() => this.show(), LOOK_EVERY_MS);
    this.show();
  }

  begin(bench) {
    this.bench = bench;
    this.orders.leave();
    this.show();
  }

  hear() {
    this.show();
    this.orders.askAgain();
  }

  show() {
    const { page } = this;
    const { sign, name, reason, tone } = describe(page, this.age.behind_s);
    const connected = tone !== "gone" && page.machine;
    const whose = connected ? `The daemon of ${page.machine.machine} is connected.` : "";
    write(this.state, [whose, `${sign} ${name}${reason ? `: ${reason}` : ""}`].filter(Boolean).join(" "));
    const summary = this.bench?.summary;
    const own = connected && summary && summary.machine === page.machine.machine;
    this.offered.hidden = this.bars.hidden = !own;
    this.orders.show();
    if (connected && !own) return write(this.models, summary ? `This recording is of ${summary.machine}: its model cannot run on ${page.machine.machine}.` : "Open a recording to run its model here.");
    write(this.models, own ? this.modelsText(page.slow?.models ?? {}, summary) : "");
    if (!own) return;
    const file = summary.ledger.length > 0;
    this.run.disabled = this.adopt.disabled = !file;
    write(this.why, file ? (page.role === "operate" ? "" : "This browser is read-only.") : "Add an effect first: there is no model file yet.");
    this.showBars(page.slow, summary);
  }

  // Which models run, in words.
  modelsText({ applied, shadow }, summary) {
    const text = (model, none) => {
      if (!model?.file) return none;
      const effects = model.effects.map(plain).join(", ") || "no effects";
      const own = model.file === summary.model ? (model.model === summary.model_hash ? ", this model as it is" : ", this model as it was: its file has changed since, run it again") : "";
      return `${fileName(model.file)} (${effects}${own})`;
    };
    return `Applied: ${text(applied, "no effects")}. Shadow: ${text(shadow, "none")}.`;
  }

  showBars({ models, model_effects } = {}, { unit, rms, ledger, recording, model_hash }) {
    if (!model_effects) return;
    const first = ledger.find((step) => fileName(step.recording).replace(/\.(csv|parquet)$/, "") === recording);
    const { applied_um, beyond_um, seconds } = model_effects;
    const rows = [[`the recording's error${first ? ", before → now" : ""}`, unit === "um" ? [...(first ? [first.before] : []), rms] : null, `its unit is ${unit}`, RECORDED]];
    const shadow = models?.shadow?.file;
    if (!shadow && models?.applied?.model === model_hash) rows.push(["live: what this model would take out beyond the applied one, which it is", [0], "", BEYOND]);
    else rows.push([`live: what the shadow${shadow ? ` (${fileName(shadow)})` : ""} would take out beyond the applied model`, beyond_um && [perCoordinate(beyond_um)], shadow ? "not known yet" : "no shadow runs", BEYOND, beyond_um]);
    rows.push(["live: what the effects of the applied model take out", applied_um && [perCoordinate(applied_um)], "not known yet", APPLIED, applied_um]);
    const scale_um = scaleFor(Math.max(0.5, ...rows.flatMap(([, values]) => values ?? [])));
    const key = JSON.stringify([rows, seconds]);
    if (key === this.drawn) return;
    this.drawn = key;
    this.bars.replaceChildren(...rows.map((row) => errorBar(scale_um, ...row)), element("p", { class: "note" }, `Bars end at ${lengthText(scale_um)}. ${seconds < 1 ? "The live numbers have just begun." : `The live numbers are of ${seconds.toFixed(0)} s.`}`), element("p", { class: "note" }, MEANING));
  }
}

// values_um: the last is filled, the first is behind it; axes_um: in x, y, z.
function errorBar(scale_um, label, values_um, unknown, colour, axes_um) {
  const pieces = (values_um ?? []).map((value_um, k) => {
    const piece = element("i", { class: k < values_um.length - 1 ? "behind-it" : "" });
    piece.style.width = `${Math.min(100, (100 * value_um) / scale_um)}%`;
    piece.style.background = colour;
    return piece;
  });
  const number = values_um ? amounts(values_um, "um") : unknown;
  const axes = axes_um ? `${["x", "y", "z"].map((axis, k) => `${axis} ${axes_um[k].toFixed(2)}`).join(", ")}; together ${amounts([Math.hypot(...axes_um)], "um")}` : "";
  return element("div", { class: "error-bar" }, element("div", { class: "head" }, element("span", {}, label), element("b", {}, number)), element("div", { class: "bar", "aria-hidden": "true" }, ...pieces), element("small", {}, axes));
}
