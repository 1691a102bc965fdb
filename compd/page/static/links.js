// One strip for each link: the correction of the last minute with its limits, its value, and its contributions.
import { keptScale, outline, stack } from "./bar.js";
import { element, ink, lengthText, signed } from "./format.js";

const SPAN_S = 60;
// Interval (ms) of drawing the charts: a line moves by at most a pixel in a tenth of a second.
const DRAW_EVERY_MS = 100;
// Height (px) of a strip: on a small screen the tip fits below them without scrolling.
const heightOf = (count) => (count === 6 ? 54 : window.innerHeight <= 820 ? 80 : 108);

export class Links {
  constructor(place, page) {
    this.place = place;
    this.page = page;
    this.times = [];
    this.corrections = [];
    this.scale_um = 1;
    this.drawn_ms = 0;
  }

  begin(machine) {
    // Scales may be fewer than links: an actuator that moves several rods has one correction.
    this.noun = (machine.mechanism?.actuators ?? []).some(({ kind }) => kind !== "extends") ? "actuator" : "link";
    const count = machine.wiring.filter(({ kind }) => kind === "scale").length;
    this.limit_um = machine.limits.correction_mm * 1000;
    this.times = [];
    this.corrections = Array.from({ length: count }, () => []);
    this.charts?.forEach((chart) => chart.destroy());
    this.rows = this.corrections.map((_, link) => this.row(link, count));
    this.scale = element("p", { class: "note" });
    this.place.replaceChildren(...this.rows.map(({ row }) => row), this.scale);
    this.charts = this.rows.map(({ plot }) => this.chart(plot, count));
    new ResizeObserver(() => this.charts.forEach((chart, k) => chart.setSize({ width: this.rows[k].plot.clientWidth, height: chart.height }))).observe(this.place);
  }

  row(link, count) {
    const number = element("b");
    const sources = element("small");
    const plot = element("div");
    const bar = element("div", { class: "bar" });
    const label = element("div", { class: "number" }, number, sources);
    const row = element("div", { class: "strip", onclick: () => this.select(link + 1) }, label, plot, bar);
    row.title = `${this.noun} ${link + 1}`;
    plot.style.height = `${heightOf(count)}px`;
    return { row, number, sources, plot, bar };
  }

  chart(place, count) {
    const limit = () => this.limit_um;
    const options = {
      width: place.clientWidth || 300,
      height: heightOf(count),
      cursor: { show: false },
      legend: { show: false },
      scales: { x: { time: false, range: (_, __, max) => [max - SPAN_S, max] }, y: { range: (_, low, high) => this.range(low, high) } },
      axes: [{ show: false }, { size: 44, stroke: () => ink("--soft"), grid: { stroke: () => ink("--rule"), width: 1 }, ticks: { show: false }, space: 24, font: "11px system-ui" }],
      series: [{}, { stroke: () => ink("--line"), width: 1.5, points: { show: false } }],
      hooks: {
        draw: [(chart) => {
          for (const edge of [limit(), -limit()]) {
            const { min, max } = chart.scales.y;
            if (edge < min || edge > max) continue;
            const y = chart.valToPos(edge, "y", true);
            chart.ctx.fillStyle = "#d55e00";
            chart.ctx.fillRect(chart.bbox.left, y - 1, chart.bbox.width, 2);
          }
        }],
      },
    };
    return new window.uPlot(options, [[], []], place);
  }

  // At least 1 µm high, and steady while the line stays inside.
  range(low, high) {
    if (!Number.isFinite(low)) return [-1, 1];
    const middle = (low + high) / 2;
    const half = Math.max((high - low) * 0.6, 0.5);
    return [middle - half, middle + half];
  }

  select(link) {
    this.page.selected = this.page.selected === link ? 0 : link;
    this.rows?.forEach(({ row }, k) => row.classList.toggle("selected", k + 1 === this.page.selected));
  }

  // Every event in time, also while frozen: the lines go on in the background.
  note({ setpoint, unix_s: now_s }) {
    if (!setpoint || !this.charts) return;
    this.times.push(now_s);
    this.corrections.forEach((line, k) => line.push(setpoint.valid ? setpoint.correction_mm[k] * 1000 : null));
    let old = 0;
    while (this.times[old] < now_s - SPAN_S) old++;
    if (old > 100) {
      this.times.splice(0, old);
      this.corrections.forEach((line) => line.splice(0, old));
    }
  }

  // The minute before the page was opened: times and, for each, the corrections of the links, nan where there were none.
  recall(times, corrections_um) {
    if (!this.charts) return;
    const first_s = this.times[0] ?? Infinity;
    const earlier = times.map((_, k) => k).filter((k) => times[k] < first_s);
    this.times = [...earlier.map((k) => times[k]), ...this.times];
    this.corrections = this.corrections.map((line, link) => [...earlier.map((k) => (Number.isNaN(corrections_um[k][link]) ? null : corrections_um[k][link])), ...line]);
  }

  // The minute before a past moment: events by tenths of a second, and before them by seconds.
  lines({ at_s, times, corrections_um }) {
    const end = this.times.findIndex((time) => time > at_s);
    const fine = this.times.slice(0, end < 0 ? undefined : end);
    const coarse = times.map((_, k) => k).filter((k) => times[k] < (fine[0] ?? Infinity));
    const numbers = (link) => coarse.map((k) => (Number.isNaN(corrections_um[k][link]) ? null : corrections_um[k][link]));
    const all = [...coarse.map((k) => times[k]), ...fine];
    return this.corrections.map((line, link) => [all, [...numbers(link), ...line.slice(0, fine.length)]]);
  }

  // An event; with `minute` a past one.
  show({ setpoint }, minute) {
    const now_ms = performance.now();
    if (minute) {
      this.lines(minute).forEach((line, k) => this.charts[k].setData(line));
    } else if (now_ms - this.drawn_ms >= DRAW_EVERY_MS && !document.hidden) {
      this.drawn_ms = now_ms;
      this.charts.forEach((chart, k) => chart.setData([this.times, this.corrections[k]]));
    }
    if (!setpoint.valid) {
      this.rows.forEach(({ number, sources, bar }, k) => {
        number.textContent = "–";
        sources.textContent = `${this.noun} ${k + 1}\nnot valid`;
        bar.replaceChildren();
      });
      return;
    }
    const causes = Object.values(setpoint.sources_mm);
    const shadow_um = setpoint.shadow?.correction_mm?.map((value) => value * 1000);
    const ends = setpoint.correction_mm.map((_, k) => Math.max(causes.reduce((sum, links) => sum + Math.abs(links[k] * 1000), 0), Math.abs(shadow_um?.[k] ?? 0)));
    this.scale_um = keptScale(this.scale_um, Math.max(...ends));
    this.scale.textContent = `Colours: causes, as at the tip. Bars end at ±${lengthText(this.scale_um)}; red lines: the limits, ±${lengthText(this.limit_um)}.`;
    this.rows.forEach(({ number, sources, bar }, k) => {
      number.textContent = signed(setpoint.correction_mm[k] * 1000);
      sources.textContent = `${this.noun} ${k + 1}${shadow_um ? `\nshadow ${signed(shadow_um[k])}` : ""}`;
      stack(bar, causes.map((links) => links[k] * 1000), this.scale_um);
      if (shadow_um) outline(bar, shadow_um[k], this.scale_um);
    });
  }
}
