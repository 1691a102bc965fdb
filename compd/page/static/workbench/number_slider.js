// A slider for one number of an effect, with the plausible band and the tick of the fit.
import { element, micro } from "../format.js";

// Length of a slider relative to the plausible range.
const BEYOND = 1.15;
// Fewest steps of a slider, each a round number.
const STEPS = 400;

export class NumberSlider {
  // number: of the card; fit: { theta, standard_error }; moved: called with theta
  constructor(number, fit, moved) {
    Object.assign(this, { number, fit, moved });
    const [low, high] = [BEYOND * Math.min(number.range[0], 0, fit.theta), BEYOND * Math.max(number.range[1], 0, fit.theta)];
    const step = 10 ** Math.floor(Math.log10((high - low) / STEPS));
    // from a multiple of the step on, so that round numbers can be chosen
    const [first, last] = [Math.floor(low / step) * step, Math.ceil(high / step) * step];
    // a wide error ends at the slider's end
    const percent = (theta) => Math.min(100, Math.max(0, (100 * (theta - first)) / (last - first)));
    const part = (name, from, to) => {
      const made = element("i", { class: name });
      made.style.left = `${percent(from)}%`;
      if (to !== undefined) made.style.width = `${percent(to) - percent(from)}%`;
      return made;
    };
    const error = fit.standard_error ?? 0;
    const plausible = [number.low, number.high].map((value) => digits(value)).join(" to ");
    this.value = element("output", {}, "");
    this.input = element("input", { type: "range", min: first, max: last, step, value: 0, "aria-label": `${number.name}, ${micro(number.unit)}`, "data-number": number.name, oninput: () => moved(Number(this.input.value)), onkeydown: (event) => this.key(event, step) });
    this.row = element("div", { class: "number-row" },
      element("div", { class: "head" }, element("b", {}, number.name), this.value),
      this.input,
      element("div", { class: "track", "aria-hidden": "true" }, part("band", ...number.range), part("fit", fit.theta - 2 * error, fit.theta + 2 * error), part("tick", fit.theta)),
      element("small", {}, `plausible ${plausible} ${micro(number.unit)}; fitted ${this.text(fit.theta)}`));
    this.show(0);
  }

  show(theta) {
    this.input.value = theta;
    this.value.textContent = this.text(theta);
  }

  // With Shift, arrows go ten times as far.
  key(event, step) {
    const by = { ArrowRight: 10, ArrowUp: 10, ArrowLeft: -10, ArrowDown: -10 }[event.key];
    if (!by || !event.shiftKey) return;
    event.preventDefault();
    this.input.value = Number(this.input.value) + by * step;
    this.moved(Number(this.input.value));
  }

  // Text for display: a compliance is fitted, and a stiffness shown.
  text(theta) {
    const { reciprocal, unit } = this.number;
    if (!reciprocal) return `${digits(theta)} ${micro(unit)}`;
    return theta === 0 ? "rigid" : `${digits(1 / theta)} ${micro(unit)}`;
  }
}

export function digits(value) {
  return Number(value.toPrecision(4)).toString().replace("-", "−");
}
