// The gauges: a line while all are good, else a table, the worst first.
import { ago, element } from "./format.js";
import { GaugeRow } from "./gauge_row.js";
import { Traces } from "./spark.js";

// Interval (ms) of updates of the table: faster numbers cannot be read.
const WRITE_EVERY_MS = 500;
// Good gauges are sorted by age in this many classes of the allowed age, so that they seldom change places.
const PARTS_OF_AGE = 4;

export class Gauges {
  constructor(place, summary, act) {
    Object.assign(this, { place, summary, act, open: false, faults: null });
  }

  begin(machine) {
    this.rows = machine.wiring.map((wire) => new GaugeRow(wire, this.act));
    this.traces = new Traces(this.rows.length);
    this.button = element("button", { type: "button", onclick: () => this.toggle() }, this.open ? "fold" : "show all");
    this.body = element("tbody");
    this.since = element("small");
    const head = (name, ...more) => element("th", { class: ["since zero", "faults"].includes(name) ? "number" : "", scope: "col" }, name, ...more);
    const recent = element("th", { class: "number", scope: "col" }, this.since);
    this.table = element("table", {}, element("thead", {}, element("tr", {}, head("measures"), head("since zero"), head("age"), head("last 60 s, range"), head("quality"), head("faults"), recent)), this.body);
    this.table.hidden = true;
    this.order = "";
    this.absent = element("ul", { class: "absent" });
    this.place.replaceChildren(this.button, this.table, this.absent);
    this.written_ms = -WRITE_EVERY_MS;
    this.recalled = false;
  }

  // The minute before `unix_s`, from the page's server.
  async recall(traces, unix_s) {
    this.recalled = true;
    const answer = await fetch(`traces?unix_s=${unix_s}`).catch(() => null);
    if (answer?.ok) traces.recall(await answer.json());
  }

  toggle() {
    this.open = !this.open;
    this.button.textContent = this.open ? "fold" : "show all";
    this.written_ms = -WRITE_EVERY_MS;
    if (this.event) this.show(this.event, this.minute);
  }

  // Faults of each gauge, of the slow event.
  count(faults) {
    this.faults = faults;
    this.since.textContent = !faults ? "" : faults.hour ? "in the last hour" : `since ${new Date(faults.since_s * 1000).toTimeString().slice(0, 5)}`;
  }

  // What no gauge measures, of the slow event.
  lack(clauses) {
    if (this.absent?.childElementCount === clauses.length) return;
    this.absent?.replaceChildren(...clauses.map((clause) => element("li", {}, `Not measured: ${clause}`)));
  }

  // Every event in time, also while frozen: the lines go on in the background.
  note({ unix_s, gauges }) {
    if (!gauges || !this.traces) return;
    if (!this.recalled) this.recall(this.traces, unix_s);
    this.traces.note(unix_s, gauges);
  }

  // An event; with `minute` a past one, whose faults are not counted.
  show(event, minute) {
    [this.event, this.minute] = [event, minute];
    const readings = event.gauges;
    if (!readings) {
      this.summary.textContent = "not known";
      this.table.hidden = true;
      return;
    }
    if (!minute && performance.now() - this.written_ms < WRITE_EVERY_MS) return;
    this.written_ms = performance.now();
    const bad = readings.filter((gauge) => gauge.fault).length;
    const oldest_s = Math.max(...readings.filter((gauge) => !gauge.fault).map((gauge) => gauge.age_s), 0);
    this.summary.textContent = bad ? `${bad} of ${readings.length} not good` : `${readings.length} good, oldest ${ago(oldest_s)}`;
    this.table.hidden = !this.open && !bad;
    if (this.table.hidden) return;
    this.rows.forEach((row, k) => row.show(readings[k], minute || !this.faults ? null : this.faultsOf(row)));
    const shown = this.sorted();
    const { times_s, values } = minute?.traces ?? { times_s: this.traces.times, values: this.traces.values };
    const place = (row) => this.rows.indexOf(row);
    shown.forEach((row) => row.draw(times_s, values[place(row)] ?? []));
  }

  faultsOf(row) {
    const gauge = row.wire.channel.split(".")[0];
    return { total: this.faults.total[gauge], recent: this.faults.recent[gauge] };
  }

  // The visible rows, in the order of the table.
  sorted() {
    const part = (row) => Math.floor(PARTS_OF_AGE * Math.min(row.share, 1));
    const sorted = this.rows.filter((row) => this.open || row.bad).sort((a, b) => b.bad - a.bad || part(b) - part(a));
    const order = sorted.map((row) => row.wire.channel).join();
    if (order !== this.order) {
      const focused = document.activeElement;
      this.body.replaceChildren(...sorted.map(({ row }) => row));
      if (this.body.contains(focused)) focused.focus();
      this.order = order;
    }
    return sorted;
  }
}
