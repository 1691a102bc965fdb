// The gauges: a line while all are good, else a table, the worst first.
import { ago, element } from "./format.js";

// The table is written so often, ms: numbers that change faster cannot be read.
const WRITE_EVERY_MS = 500;

export class Gauges {
  constructor(place, summary, drawer) {
    this.place = place;
    this.summary = summary;
    this.drawer = drawer;
    this.open = false;
    this.faults = {};
  }

  begin(machine) {
    this.wiring = machine.wiring.map((wire) => ({ ...wire, measures: wire.name ?? (wire.distance ? `frame ${wire.distance}` : `${wire.kind} of link ${wire.link}${wire.role ? `, ${wire.role}` : ""}`) }));
    this.button = element("button", { type: "button", onclick: () => this.toggle() }, "show all");
    this.body = element("tbody");
    const names = ["measures", "channel", "since zero", "age", "quality", "faults"];
    const head = element("tr", {}, ...names.map((name) => element("th", { class: ["since zero", "faults"].includes(name) ? "number" : "" }, name)));
    this.table = element("table", {}, element("thead", {}, head), this.body);
    this.table.hidden = true;
    this.place.replaceChildren(this.button, this.table);
    this.written_ms = -WRITE_EVERY_MS;
  }

  toggle() {
    this.open = !this.open;
    this.button.textContent = this.open ? "fold" : "show all";
    this.written_ms = -WRITE_EVERY_MS;
    if (this.told) this.show(this.told, this.minute);
  }

  // Faults of each gauge since the daemon's start, from STATUS.
  count(status) {
    const polled = Object.values(status.lines).flatMap((line) => Object.entries(line.gauges));
    this.faults = Object.fromEntries(polled.map(([name, told]) => [name, Object.values(told.faults).reduce((a, b) => a + b, 0)]));
  }

  // An event; with `minute` one that has been, of which faults are not counted.
  show(event, minute) {
    [this.told, this.minute] = [event, minute];
    const told = event.gauges;
    if (!told) {
      this.summary.textContent = "not known";
      this.table.hidden = true;
      return;
    }
    if (!minute && performance.now() - this.written_ms < WRITE_EVERY_MS) return;
    this.written_ms = performance.now();
    const gauges = this.wiring.map((wire, k) => ({ ...wire, ...told[k], share: (told[k].age_s ?? Infinity) / wire.stale_after_s }));
    const bad = gauges.filter((gauge) => gauge.fault);
    const oldest_s = Math.max(...gauges.filter((gauge) => !gauge.fault).map((gauge) => gauge.age_s), 0);
    this.summary.textContent = bad.length ? `${bad.length} of ${gauges.length} not good` : `${gauges.length} good, oldest ${ago(oldest_s)}`;
    this.table.hidden = !this.open && !bad.length;
    if (this.table.hidden) return;
    gauges.sort((a, b) => Boolean(b.fault) - Boolean(a.fault) || b.share - a.share);
    this.body.replaceChildren(...(this.open ? gauges : gauges.slice(0, bad.length)).map((gauge) => this.row(gauge)));
  }

  row(gauge) {
    const fill = element("i");
    fill.style.width = `${100 * Math.min(1, gauge.share)}%`;
    const unit = gauge.kind === "quantity" ? "" : " mm";
    const accept = gauge.fault === "distrusted" ? [" ", element("button", { type: "button", onclick: () => this.drawer.ask("accept", gauge.channel) }, "Accept …")] : [];
    const quality = gauge.fault ? `${gauge.fault.replaceAll("_", " ")}${gauge.detail ? `: ${gauge.detail}` : ""}` : "ok";
    return element(
      "tr",
      { class: gauge.fault ? "bad" : "" },
      element("td", { class: "name" }, gauge.measures),
      element("td", { class: "name" }, gauge.channel),
      element("td", { class: "number value" }, gauge.value === undefined ? "–" : gauge.value.toFixed(gauge.kind === "quantity" ? 2 : 4) + unit),
      element("td", { class: "name" }, element("span", { class: gauge.fault ? "age old" : "age" }, fill), gauge.age_s === undefined ? "" : ` ${ago(gauge.age_s)}`),
      element("td", { class: "quality", title: quality }, ...accept, quality),
      element("td", { class: "number" }, this.minute ? "–" : String(this.faults[gauge.channel.split(".")[0]] ?? "")),
    );
  }
}
