// Round numbers for axes, rings and scale bars.
import { ink } from "../format.js";

const TEXT_PX = 11;
const TICK_PX = 4;

// The largest of 1, 2 and 5 times a power of ten that is not above a value.
export function roundBelow(value) {
  const power = 10 ** Math.floor(Math.log10(value) + 1e-9);
  return [5, 2, 1].find((step) => step * power <= value * (1 + 1e-9)) * power;
}

// Round numbers from low to high, at most so many and one, as [number, text].
export function ticks(low, high, most) {
  if (!(high > low)) return [];
  const least = (high - low) / most;
  const below = roundBelow(least);
  const step = below < least * (1 - 1e-9) ? roundBelow(2.5 * below) : below;
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const first = Math.ceil(low / step - 1e-9);
  const count = Math.floor(high / step + 1e-9) - first + 1;
  return Array.from({ length: Math.max(0, count) }, (_, k) => [(first + k) * step, written((first + k) * step, digits)]);
}

// A number with so many decimals; of a step below a millionth, or beyond a million, in powers of ten.
function written(value, digits) {
  if (digits > 6 || Math.abs(value) >= 1e7) return value.toExponential(2);
  return value.toFixed(digits).replace(/^-(0\.?0*)$/, "$1").replace("-", "−");
}

// A value with its step's decimals and the unit, for a scale bar.
export function barText(value, unit) {
  return `${value >= 1 ? value : Number(value.toPrecision(1))} ${unit}`;
}

// The horizontal axis below a picture, with numbers and a title. at: a value to x
export function axisBelow(context, { low, high, left, right, y, title, at, grid = 0 }) {
  label(context);
  const shown = ticks(low, high, Math.max(2, Math.floor((right - left) / 70)));
  context.textAlign = "center";
  for (const [value, text] of shown) {
    stroke(context, "--rule", at(value), y - grid, at(value), y + TICK_PX);
    context.fillText(text, at(value), y + TICK_PX + TEXT_PX);
  }
  stroke(context, "--soft", left, y, right, y);
  context.fillText(title, (left + right) / 2, y + TICK_PX + 2.3 * TEXT_PX);
  context.textAlign = "left";
}

// The vertical axis at the left, with numbers and a title that is turned. at: a value to y
export function axisLeft(context, { low, high, top, bottom, x, title, at, grid = 0, apart = 40, space = 44 }) {
  label(context);
  context.textAlign = "right";
  for (const [value, text] of ticks(low, high, Math.max(2, Math.floor((bottom - top) / apart)))) {
    stroke(context, "--rule", x - TICK_PX, at(value), x + grid, at(value));
    context.fillText(text, x - TICK_PX - 2, at(value) + 4);
  }
  stroke(context, "--soft", x, top, x, bottom);
  context.textAlign = "center";
  context.save();
  context.translate(x - space, (top + bottom) / 2);
  context.rotate(-Math.PI / 2);
  context.fillText(title, 0, 0);
  context.restore();
  context.textAlign = "left";
}

// The font and colour of numbers at axes.
export function label(context) {
  context.font = `${TEXT_PX}px system-ui`;
  context.fillStyle = ink("--soft");
}

export function stroke(context, colour, x0, y0, x1, y1) {
  context.strokeStyle = ink(colour);
  context.beginPath();
  context.moveTo(x0, y0);
  context.lineTo(x1, y1);
  context.stroke();
}

// A bar of a round length at the lower left, with its length in words. per_px: of the unit
export function scaleBar(context, { x, y, per_px, unit, longest_px, colour = "--ink" }) {
  const length = roundBelow(longest_px * per_px);
  const px = length / per_px;
  for (const end of [x, x + px]) stroke(context, colour, end, y - 4, end, y + 4);
  stroke(context, colour, x, y, x + px, y);
  label(context);
  context.fillText(barText(length, unit), x + px + 6, y + 4);
}
