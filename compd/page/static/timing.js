// Timing of the loop.
import { dateText, element } from "./format.js";

export function showTiming(list, status) {
  const loop = status.loop;
  const us = (value) => (value === undefined ? "–" : `${value.toFixed(0)} µs`);
  const granted = Object.entries(status.realtime).map(([name, setting]) => `${setting.granted ? "✓" : "✕"} ${name.replaceAll("_", " ")}`);
  const rows = [
    ["rate", `${loop.rate_hz} Hz`],
    ["late, median", us(loop.lateness_median_us)],
    ["late, 99 %", us(loop.lateness_p99_us)],
    ["cycle, 99 %", us(loop.cycle_p99_us)],
    ["missed cycles", `${loop.missed_cycles} of ${loop.cycles + loop.missed_cycles}`],
    ["real time", granted.join(", ")],
    ["machine zero", status.zero.taken ? dateText(new Date(status.zero.taken_at)) : "none"],
    ["model", status.model.applied?.effects.join(", ") || "no effects"],
    ["clients of the daemon", status.publisher.connected.map((client) => client.name + (client.controller ? " (controller)" : "")).join(", ")],
  ];
  list.replaceChildren(...rows.flatMap(([name, text]) => [element("dt", {}, name), element("dd", {}, text)]));
}
