// The last hour: its states as a tape, and the displacement of the tip; a click or drag goes to a moment and freezes the page.
import { element, ink, prepared } from "./format.js";
import { NOT_KEPT, clock as exactly } from "./past.js";
import { appearance, COLOURS, NAMES } from "./states.js";
import { TimeWindow, gestures } from "./time_window.js";

const HOUR_S = 3600;
const MINUTE_S = 60;
const HOW_TO = "Click or drag on the tape to go to a moment.";
const clock = (time_s, span_s = HOUR_S) => new Date(time_s * 1000).toTimeString().slice(0, span_s < 600 ? 8 : 5);
const DRAW_EVERY_MS = 1000;
// Height of states on the tape, as px from its edges: worse ones are higher, so that colour is not the only sign.
const INSET = { good: 8, care: 4, bad: 0, gone: 12 };

export class Hour {
  constructor(tape, place, scrub, links) {
    Object.assign(this, { tape, place, scrub, links, columns: [], times: [], rows: [], chart: null, at_s: null, drawn_ms: 0, window: new TimeWindow() });
    scrub.textContent = HOW_TO;
    tape.addEventListener("pointermove", (event) => this.name(this.timeAt(event.offsetX)));
    const go = (share) => this.go(this.window.timeAt(share));
    gestures(tape, { click: go, drag: go, zoom: (factor, share) => this.zoom(factor, share) });
  }

  // share: of the width, that keeps its moment; without it, the shown moment or the newest does
  zoom(factor, share) {
    this.window.zoom(factor, share === undefined ? this.at_s ?? this.end_s : this.window.timeAt(share));
    this.draw(true);
  }

  whole() {
    this.window.whole();
    this.draw(true);
  }

  // Fetch the past, and continue from there.
  async begin() {
    const response = await fetch("history");
    if (!response.ok) return;
    const data = await response.arrayBuffer();
    const end = new Uint8Array(data).indexOf(10);
    const header = JSON.parse(new TextDecoder().decode(data.slice(0, end)));
    this.columns = header.columns;
    let start = end + 1;
    for (const { name, rows } of header.tables) {
      const times = new Float64Array(data.slice(start, start + 8 * rows));
      start += 8 * rows;
      const values = new Float32Array(data.slice(start, start + 4 * rows * this.columns.length));
      start += 4 * rows * this.columns.length;
      const table = [...times].map((_, k) => values.slice(k * this.columns.length, (k + 1) * this.columns.length));
      if (name === "coarse") [this.times, this.rows] = [[...times], table];
      else this.links.recall([...times], table.map((row) => this.corrections(row)));
    }
    this.draw(true);
  }

  // A row a second, as the server keeps them.
  note({ unix_s, setpoint, budget }) {
    if (!this.columns.length || unix_s < (this.times.at(-1) ?? 0) + 0.95) return;
    const row = new Float32Array(this.columns.length).fill(NaN);
    if (setpoint) {
      row[0] = NAMES.indexOf(setpoint.state);
      if (setpoint.valid) {
        const moved = [0, 1, 2].map((axis) => Object.values(budget ?? {}).reduce((sum, vector) => sum + vector[axis], 0));
        row.set([...setpoint.correction_mm.map((value) => value * 1000), ...setpoint.tip_M_mm, ...(budget ? moved : [])], 1);
      }
    }
    this.times.push(unix_s);
    this.rows.push(row);
    while (this.times[0] < unix_s - HOUR_S) {
      this.times.shift();
      this.rows.shift();
    }
    this.draw();
  }

  corrections(row) {
    return [...row.slice(1, 1 + this.columns.filter((name) => name.startsWith("correction_")).length)];
  }

  get end_s() {
    return this.times.at(-1) ?? 0;
  }

  timeAt(x) {
    return this.window.timeAt(x / this.tape.clientWidth);
  }

  // Time and state under the pointer.
  name(time_s) {
    const k = this.times.findIndex((time) => time >= time_s);
    const known = k >= 0 && this.times[k] < time_s + 2;
    this.tape.title = `${clock(time_s)} ${known ? (Number.isNaN(this.rows[k][0]) ? "no daemon" : NAMES[this.rows[k][0]] ?? "unknown") : "not kept"}`;
  }

  draw(now = false) {
    if (!now && (performance.now() - this.drawn_ms < DRAW_EVERY_MS || document.hidden)) return;
    this.drawn_ms = performance.now();
    this.window.end_s = this.end_s;
    const { context, width, height } = prepared(this.tape);
    context.fillStyle = "#8c959f33";
    context.fillRect(0, 0, width, height);
    const pixel = width / this.window.span_s;
    const x = (time_s) => width * this.window.shareOf(time_s);
    this.rows.forEach((row, k) => {
      const state = Number.isNaN(row[0]) ? null : NAMES[row[0]];
      const tone = state === null ? "gone" : appearance(state)[0];
      context.fillStyle = COLOURS[tone];
      // bad states are at least two pixels wide
      const wide = Math.max(pixel * 1.05, tone === "good" ? 0.5 : 2);
      const inset = INSET[tone];
      context.fillRect(x(this.times[k]) - pixel, inset, wide, height - 2 * inset);
    });
    if (this.at_s !== null) {
      context.fillStyle = ink("--ink");
      context.fillRect(x(this.at_s) - 1, 0, 2, height);
    }
    this.drawChart();
  }

  drawChart() {
    const first = this.columns.indexOf("moved_x_um");
    if (first < 0) return;
    const data = [this.times, ...[0, 1, 2].map((axis) => this.rows.map((row) => (Number.isNaN(row[first + axis]) ? null : row[first + axis])))];
    if (!this.chart) {
      const axis = { stroke: () => ink("--soft"), grid: { stroke: () => ink("--rule"), width: 1 }, ticks: { show: false }, font: "11px system-ui" };
      this.chart = new window.uPlot({
        width: this.place.clientWidth || 400,
        height: 130,
        legend: { show: false },
        cursor: { drag: { x: false, y: false } },
        scales: { x: { range: () => [this.window.left, this.window.right] } },
        axes: [{ ...axis, size: 24, values: (_, times) => times.map((time) => clock(time, this.window.span_s)) }, { ...axis, size: 44 }],
        series: [{}, ...[["x", []], ["y", [6, 3]], ["z", [2, 2]]].map(([label, dash]) => ({ label, stroke: () => ink(`--${label}`), dash, width: 1.5, points: { show: false }, spanGaps: false }))],
      }, data, this.place);
      gestures(this.chart.over, {
        click: (share) => this.go(this.window.timeAt(share)),
        drag: (_, by) => {
          this.window.pan(-by * this.window.span_s);
          this.draw(true);
        },
        zoom: (factor, share) => this.zoom(factor, share),
      });
      this.place.append(element("p", { class: "note" }, "tip displacement, µm: x orange, y green dashed, z blue dotted"));
      new ResizeObserver(() => this.chart.setSize({ width: this.place.clientWidth, height: 130 })).observe(this.place);
    } else this.chart.setData(data);
  }

  // The seconds of the minute before `at_s`: times, corrections of the links, places of the tip.
  minute(at_s) {
    const [links, tip] = [this.columns.filter((name) => name.startsWith("correction_")).length, this.columns.indexOf("tip_x_mm")];
    const kept = this.times.map((_, k) => k).filter((k) => this.times[k] >= at_s - MINUTE_S && this.times[k] <= at_s);
    return {
      times: kept.map((k) => this.times[k]),
      corrections_um: kept.map((k) => [...this.rows[k].slice(1, 1 + links)]),
      tips_mm: kept.map((k) => [...this.rows[k].slice(tip, tip + 3)]),
    };
  }

  // Freeze at the shown event.
  stop(event) {
    if (event) this.go(event.unix_s, event);
  }

  // Freeze at `time_s`, or the nearest stored moment, whose `event` is known already.
  go(time_s, event = null) {
    if (!this.times.length) return;
    const newest_s = Math.max(this.end_s, event?.unix_s ?? 0);
    this.at_s = Math.min(Math.max(time_s, this.times[0]), newest_s);
    this.scrub.textContent = `${exactly(this.at_s)} is shown: the last minute is kept by tenths of a second, the hour by seconds. ${NOT_KEPT}`;
    this.window.reveal(this.at_s);
    document.dispatchEvent(new CustomEvent("freeze", { detail: { at_s: this.at_s, event } }));
    this.draw(true);
  }

  step(seconds) {
    this.go((this.at_s ?? this.end_s) + seconds);
  }

  follow() {
    this.at_s = null;
    this.window.right_s = null;
    this.scrub.textContent = HOW_TO;
    this.draw(true);
  }
}
