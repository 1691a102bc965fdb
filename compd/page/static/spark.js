// The last minute of a gauge as a small line, with its range.
import { ink, prepared } from "./format.js";

export const SPAN_S = 60;
const EVERY_S = 0.95;

// One value a second of every gauge.
export class Traces {
  constructor(count) {
    Object.assign(this, { times: [], values: Array.from({ length: count }, () => []) });
  }

  note(time_s, gauges) {
    if (time_s < (this.times.at(-1) ?? -Infinity) + EVERY_S) return false;
    this.times.push(time_s);
    this.values.forEach((line, k) => line.push(gauges[k]?.value ?? null));
    while (this.times[0] < time_s - SPAN_S) {
      this.times.shift();
      this.values.forEach((line) => line.shift());
    }
    return true;
  }

  // Stored values of the page's server, before the first own ones.
  recall({ times_s, values }) {
    if (values.length !== this.values.length) return;
    const earlier = times_s.filter((time) => time < (this.times[0] ?? Infinity) - EVERY_S).length;
    this.times = [...times_s.slice(0, earlier), ...this.times];
    this.values = this.values.map((line, k) => [...values[k].slice(0, earlier), ...line]);
  }

  copy() {
    return { times_s: [...this.times], values: this.values.map((line) => [...line]) };
  }
}

export function rangeOf(values) {
  const known = values.filter((value) => value !== null);
  return known.length ? [Math.min(...known), Math.max(...known)] : null;
}

// The line fills the height, except for ranges below `least`, so that noise does not look like a movement. It has gaps
// at missing values.
export function drawSpark(canvas, times, values, least) {
  const { context, width, height } = prepared(canvas);
  const range = rangeOf(values);
  if (!range) return;
  const middle = (range[0] + range[1]) / 2;
  const half = Math.max(range[1] - range[0], least) / 2;
  const end = times.at(-1);
  context.beginPath();
  let drawn = false;
  times.forEach((time, k) => {
    if (values[k] === null) {
      drawn = false;
      return;
    }
    const x = width * (1 - (end - time) / SPAN_S);
    const y = height / 2 - ((values[k] - middle) / half) * (height / 2 - 2);
    if (drawn) context.lineTo(x, y);
    else context.moveTo(x, y);
    drawn = true;
  });
  context.strokeStyle = ink("--line");
  context.lineWidth = 1.5;
  context.stroke();
}
