// What has moved the tip: one bar for each axis, stacked by cause, with the uncertainty as a whisker.
import { causeColour, element, signed } from "./format.js";

// The scale is one of these, µm, so that it does not jump with every number.
const SCALES_UM = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000];

export function scaleFor(largest_um) {
  return SCALES_UM.find((scale) => scale >= largest_um) ?? largest_um;
}

// Parts one after the other: the positive ones to the right of the middle, the negative ones to the left.
export function stack(bar, parts_um, scale_um) {
  let [right, left] = [50, 50];
  const pieces = parts_um.map((part_um, k) => {
    const width = Math.min(50, (50 * Math.abs(part_um)) / scale_um);
    const piece = element("i");
    piece.style.background = causeColour(k);
    piece.style.width = `${width}%`;
    if (part_um >= 0) {
      piece.style.left = `${right}%`;
      right += width;
    } else {
      left -= width;
      piece.style.left = `${left}%`;
    }
    return piece;
  });
  bar.replaceChildren(...pieces, element("i", { class: "nought" }));
}

export class Budget {
  constructor(place, page) {
    this.place = place;
    this.page = page;
    this.scale_um = 1;
  }

  begin() {
    this.rows = ["x", "y", "z"].map((axis) => {
      const bar = element("div", { class: "bar" });
      const number = element("div", { class: "number" });
      return { bar, number, row: element("div", { class: "axis" }, element("b", {}, axis), bar, number) };
    });
    this.legend = element("div", { class: "legend" });
    this.scale = element("p", { class: "note" });
    this.causes = "";
    this.place.replaceChildren(...this.rows.map(({ row }) => row), this.legend, this.scale);
  }

  show({ budget, setpoint }) {
    const causes = budget ? Object.keys(budget) : [];
    const key = `${causes.join()} ${Boolean(setpoint.u_tip_um)}`;
    if (key !== this.causes) {
      this.causes = key;
      this.legend.replaceChildren(...causes.map((cause, k) => {
        const patch = element("i");
        patch.style.background = causeColour(k);
        return element("span", {}, patch, cause.replaceAll("_", " "));
      }), element("span", {}, setpoint.u_tip_um ? "— uncertainty, 95 %" : "uncertainty not known: a gauge declares no noise_um"));
    }
    const vectors = causes.map((cause) => budget[cause]);
    const sums = [0, 1, 2].map((axis) => vectors.map((vector) => Math.abs(vector[axis])).reduce((a, b) => a + b, 0));
    const wanted = scaleFor(Math.max(...sums, 0.5));
    if (wanted > this.scale_um || wanted < this.scale_um / 4) this.scale_um = wanted;
    this.rows.forEach(({ bar, number }, axis) => {
      if (!vectors.length) {
        bar.replaceChildren();
        number.textContent = "–";
        return;
      }
      const parts = vectors.map((vector) => vector[axis]);
      stack(bar, parts, this.scale_um);
      const sum = parts.reduce((a, b) => a + b, 0);
      const u = setpoint.u_tip_um ? 2 * setpoint.u_tip_um[axis] : NaN;
      if (Number.isFinite(u)) {
        const whisker = element("i", { class: "whisker" });
        whisker.style.left = `${50 + (50 * (sum - u)) / this.scale_um}%`;
        whisker.style.width = `${(100 * u) / this.scale_um}%`;
        bar.append(whisker);
      }
      number.textContent = `${signed(sum)}${Number.isFinite(u) ? ` ± ${u.toFixed(1)}` : ""} µm`;
    });
    this.scale.textContent = `bars end at ±${this.scale_um} µm`;
  }
}
