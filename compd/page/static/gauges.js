// The gauges: a line while all are good, else a table, the worst first.
import { ago, element } from "./format.js";

export class Gauges {
  constructor(place, summary, page) {
    this.place = place;
    this.summary = summary;
    this.page = page;
    this.open = false;
  }

  begin(machine) {
    this.stale_s = Object.fromEntries(machine.wiring.map((wire) => [wire.channel, wire.stale_after_s]));
    this.button = element("button", { type: "button", onclick: () => this.toggle() }, "show all");
    this.body = element("tbody");
    const names = ["measures", "channel", "value", "age", "quality", ""];
    const head = element("tr", {}, ...names.map((name) => element("th", { class: name === "value" ? "number" : "" }, name)));
    this.table = element("table", {}, element("thead", {}, head), this.body);
    this.place.replaceChildren(this.button, this.table);
    this.table.hidden = true;
  }

  toggle() {
    this.open = !this.open;
    this.button.textContent = this.open ? "fold" : "show all";
    if (this.page.slow?.status) this.status(this.page.slow.status);
  }

  show() {} // by `status`, once a second

  status(status) {
    if (!this.body) return;
    const gauges = status.gauges.map((gauge) => ({ ...gauge, share: (gauge.age_s ?? Infinity) / (this.stale_s[gauge.channel] ?? Infinity) }));
    const bad = gauges.filter((gauge) => gauge.quality !== "ok");
    const oldest = Math.max(...gauges.filter((gauge) => gauge.quality === "ok").map((gauge) => gauge.age_s), 0);
    this.summary.textContent = bad.length ? `${bad.length} of ${gauges.length} not good` : `${gauges.length} good, oldest ${ago(oldest)}`;
    this.table.hidden = !this.open && !bad.length;
    if (this.table.hidden) return;
    gauges.sort((a, b) => (b.quality !== "ok") - (a.quality !== "ok") || b.share - a.share);
    const shown = this.open ? gauges : bad;
    this.body.replaceChildren(...shown.map((gauge) => this.row(gauge, status)));
  }

  row(gauge, status) {
    const fill = element("i");
    fill.style.width = `${Math.min(100, 100 * (Number.isFinite(gauge.share) ? gauge.share : 0))}%`;
    const bar = element("span", { class: gauge.quality === "ok" ? "age" : "age old", title: gauge.age_s === undefined ? "" : ago(gauge.age_s) }, fill);
    const value = gauge.value === undefined ? "–" : gauge.value.toFixed(4);
    const polled = Object.values(status.lines).flatMap((line) => Object.entries(line.gauges)).find(([name]) => name === gauge.channel.split(".")[0]);
    const faults = polled ? Object.values(polled[1].faults).reduce((a, b) => a + b, 0) : 0;
    return element(
      "tr",
      { class: gauge.quality === "ok" ? "" : "bad" },
      element("td", {}, gauge.measures ?? ""),
      element("td", {}, gauge.channel),
      element("td", { class: "number value" }, value),
      element("td", {}, bar, ` ${gauge.age_s === undefined ? "" : ago(gauge.age_s)}`),
      element("td", { title: gauge.detail ?? "" }, gauge.quality.replaceAll("_", " ") + (gauge.detail && gauge.quality !== "ok" ? `: ${gauge.detail}` : "")),
      element("td", { class: "number" }, faults ? `${faults} faults` : ""),
    );
  }
}
