// One effect: its description, a slider for each number, its fit, similar effects, and the step that adds it.
import { CommandLine } from "../command_line.js";
import { amounts, element } from "../format.js";
import { ConstantSlider } from "./constant_slider.js";
import { NumberSlider } from "./number_slider.js";
import { Proposal } from "./proposal.js";
import { Signature } from "./signature.js";
import { Trial } from "./trial.js";

const words = (effect) => effect.replaceAll("_", " ");

export class Card {
  // plan: called with the effects that a measurement is to distinguish
  constructor(place, plan = null) {
    Object.assign(this, { place, plan, theta: [], card: null, variant: 0, last: null });
  }

  begin(bench) {
    this.bench = bench;
    this.last = this.card && { asked: this.card.asked, theta: this.theta, variant: this.variant };
    this.card = null;
    this.place.replaceChildren(element("h2", {}, "Effect"), element("p", { class: "note" }, "Choose an effect on the left: its sliders come here, and the residual follows them."));
  }

  choose(effect) {
    const { bench } = this;
    this.card = bench.trial = null;
    bench.tried(null);
    bench.trying = effect;
    return bench.attempt(async () => {
      const card = await bench.get(`effects/${effect}`);
      Object.assign(this, { card, variant: 0, theta: card.numbers.map(() => 0), trials: new Map() });
      this.show(bench.summary.commands.add.replace("EFFECT", () => card.named));
      if (!card.variants.length) return;
      void bench.doubtOf(effect).catch(() => {}); // whether the rows support it is shown with the trial
      await this.restore();
      // the other choices of its constants, so that they follow the slider, too
      for (let k = 1; k < card.variants.length && this.card === card; k++) await this.trial(k);
    });
  }

  // The numbers that were set before other rows or another model were shown; else all are nought.
  async restore() {
    const { card, last, theta } = this;
    this.last = null;
    const again = last?.asked === card.asked && last.theta.length === theta.length && last.variant < card.variants.length;
    await this.turnTo(again ? last.variant : 0);
    if (!again || this.card !== card || theta.some((value) => value !== 0)) return;
    this.constant?.show(last.variant);
    last.theta.forEach((value, k) => value !== 0 && this.set(k, value));
  }

  // Its trial with one choice of its constants; each is fetched once.
  trial(variant) {
    const { bench, card, trials } = this;
    if (!trials.has(variant)) trials.set(variant, bench.arrays(`effects/${card.asked}/${variant}`).then((packed) => new Trial(packed, bench.rows)));
    return trials.get(variant);
  }

  async turnTo(variant) {
    const { bench, card } = this;
    this.variant = variant;
    const trial = await this.trial(variant);
    if (this.card !== card || this.variant !== variant) return; // another was chosen meanwhile
    bench.trial = trial;
    const best = card.variants[variant].left_out_rms;
    this.left_out.textContent = `Error on rows left out, with its fit: ${amounts([best], bench.summary.unit)}.`;
    this.signature.show(bench.rows, trial, card);
    if (this.theta.some((value) => value !== 0)) bench.tried(this.theta);
  }

  // command: that adds the effect, as a command line
  show(command) {
    const { card } = this;
    const variant = card.variants[0];
    const button = (text, act, id, title) => element("button", { type: "button", id, title, onclick: act }, text);
    this.left_out = element("p", { class: "note", id: "left-out" });
    this.signature = new Signature();
    this.proposal = new Proposal();
    this.sliders = variant ? card.numbers.map((number, k) => new NumberSlider(number, { theta: variant.theta[k], standard_error: variant.standard_error[k] }, (theta) => this.set(k, theta))) : [];
    this.constant = card.constants.length && card.variants.length > 1 ? new ConstantSlider(card, 0, (variant) => this.bench.attempt(() => this.turnTo(variant))) : null;
    const constants = this.constant ? [this.constant.row] : [];
    this.place.replaceChildren(
      element("h2", {}, words(card.effect)),
      element("p", {}, card.physics),
      element("p", { class: "equation" }, card.equation),
      ...Object.entries(card.symbols).map(([symbol, meaning]) => element("p", { class: "note" }, `${symbol}: ${meaning}`)),
      ...(variant
        ? [...this.sliders.map(({ row }) => row), ...constants, this.left_out, element("div", { class: "row" }, button("Fit", () => this.fit(), "fit", "Sliders to the fit (key 0)"), button("Add …", () => this.add(), "add", "Shows first what would change (key a)")), new CommandLine(command).row]
        : [element("p", { class: "note" }, `Not testable on this recording: ${card.why_not}`)]),
      this.proposal.place,
      ...this.rivals(),
      ...(variant ? [this.signature.place] : []),
      element("p", { class: "note" }, `Source: ${card.source}`),
    );
  }

  // Similar effects, on these rows or in general, and the measurement that distinguishes them.
  rivals() {
    const { effect, alike, mistaken_for, separated_by } = this.card;
    const here = alike.map(({ effect: other, cosine }) => element("li", {}, `${words(other)}, cosine ${cosine.toFixed(3)}`));
    const plan = this.plan && alike.length ? [element("button", { type: "button", onclick: () => this.plan([effect, ...alike.map((other) => other.effect)]) }, "Plan what tells them apart …")] : [];
    return [
      ...(here.length ? [element("p", {}, "Similar effects on these rows:"), element("ul", {}, ...here), ...plan] : []),
      ...(mistaken_for.length ? [element("p", { class: "note" }, `May be mistaken for ${mistaken_for.map(words).join(", ")}; told apart by ${separated_by}.`)] : []),
    ];
  }

  set(k, theta) {
    this.theta[k] = theta;
    this.sliders[k].show(theta);
    this.bench.tried(this.theta);
  }

  // Move all numbers to the best fit.
  fit() {
    if (!this.card?.variants.length) return;
    this.theta = [...this.card.variants[this.variant].theta];
    this.sliders.forEach((slider, k) => slider.show(this.theta[k]));
    this.bench.tried(this.theta);
  }

  add() {
    if (this.card?.variants.length) this.proposal.show(this.bench, { kind: "add", effect: this.card.asked }, "Add it to the model");
  }
}
