// A bar of contributions about a middle of zero: each cause, their sum, and beside it that of a shadow model.
import { causeColour, element } from "./format.js";

// Possible scales (µm), so that the scale does not jump with every number.
const SCALES_UM = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000];

export function scaleFor(largest_um) {
  return SCALES_UM.find((scale) => scale >= largest_um) ?? largest_um;
}

// The scale, kept while the largest number fits and stays visible.
export function keptScale(scale_um, largest_um) {
  const wanted = scaleFor(Math.max(largest_um, 0.5));
  return wanted > scale_um || wanted < scale_um / 4 ? wanted : scale_um;
}

// Parts one after the other: the positive ones to the right of the middle, the negative ones to the left. A tick is at
// their sum.
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
  const sum = element("i", { class: "sum" });
  sum.style.left = `${placeOf(parts_um.reduce((a, b) => a + b, 0), scale_um)}%`;
  bar.replaceChildren(...pieces, element("i", { class: "nought" }), sum);
}

// The sum of the shadow model, from zero.
export function outline(bar, value_um, scale_um) {
  const end = placeOf(value_um, scale_um);
  const made = element("i", { class: "shadow", title: "the shadow model, which is not applied" });
  made.style.left = `${Math.min(50, end)}%`;
  made.style.width = `${Math.abs(end - 50)}%`;
  bar.append(made);
}

// Uncertainty to both sides of a value.
export function whisker(bar, value_um, u_um, scale_um) {
  const [from, to] = [placeOf(value_um - u_um, scale_um), placeOf(value_um + u_um, scale_um)];
  const made = element("i", { class: "whisker" });
  made.style.left = `${from}%`;
  made.style.width = `${to - from}%`;
  bar.append(made);
}

function placeOf(value_um, scale_um) {
  return Math.max(0, Math.min(100, 50 + (50 * value_um) / scale_um));
}
