// A slider for the nonlinear constants of an effect: their choices were computed beforehand, one after another.
import { element } from "../format.js";
import { digits } from "./number_slider.js";

export class ConstantSlider {
  // card: of the effect; variant: the choice that is shown; moved: called with another
  constructor(card, variant, moved) {
    const name = card.constants[0].name;
    // in the order of the first constant, so that the slider is monotonic
    this.order = card.variants.map((_, k) => k).sort((a, b) => card.variants[a].constants[name] - card.variants[b].constants[name]);
    const text = (k) => card.constants.map((constant) => `${constant.name} ${digits(card.variants[k].constants[constant.name] ?? NaN)} ${constant.unit === "1" ? "" : constant.unit}`.trim()).join(", ");
    const value = element("output", {}, text(variant));
    this.show = (k) => {
      this.input.value = this.order.indexOf(k);
      value.textContent = text(k);
    };
    this.input = element("input", { type: "range", min: 0, max: this.order.length - 1, step: 1, value: this.order.indexOf(variant), "aria-label": `Constants ${card.constants.map((constant) => constant.name).join(", ")}`, "data-constants": "", oninput: () => {
      const chosen = this.order[Number(this.input.value)];
      this.show(chosen);
      moved(chosen);
    } });
    this.row = element("div", { class: "number-row" }, element("div", { class: "head" }, element("b", {}, card.constants.map((constant) => constant.name).join(", ")), value), this.input, element("small", {}, `${this.order.length} choices; best here: ${text(0)}`));
  }
}
