// The page: takes the events, paints the newest of them once a frame, and never an old one as the present.
import { Age, LATE_S, SILENT_S } from "./age.js";
import { showBanner } from "./banner.js";
import { Budget } from "./budget.js";
import { Gauges } from "./gauges.js";
import { Hour } from "./hour.js";
import { bindKeys } from "./keys.js";
import { Links } from "./links.js";
import { listen } from "./live_events.js";
import { Machine } from "./machine.js";
import { NOT_KEPT, Past, clock, showMoment } from "./past.js";
import { showTiming } from "./timing.js";

export const page = { live: null, slow: null, machine: null, id: "", role: "view", frozen: false, selected: 0, unpainted: false };
const age = new Age();
const at = (id) => document.getElementById(id);

// loaded when it is first opened: nothing of it is in sight before
const drawer = {
  made: null,
  async make() {
    const { Drawer } = await import("./drawer.js");
    if (!this.made) {
      this.made = new Drawer(at("drawer"), page);
      if (page.slow) this.made.show(page.slow);
    }
    return this.made;
  },
  get open() {
    return !at("drawer").hidden;
  },
  toggle: async () => (await drawer.make()).toggle(),
  ask: async (name, subject) => (await drawer.make()).ask(name, subject),
};
const machine = new Machine(at("scene"), at("colours"), page);
const links = new Links(at("strips"), page);
const budget = new Budget(at("budget"));
const gauges = new Gauges(at("gauge-table"), at("gauges-summary"), {
  accept: (channel) => drawer.ask("accept", channel),
  mayAccept: () => page.role === "operate",
  select: (wire) => (wire.link ? links.select(wire.kind === "joint" ? machine.actuatorOf(wire.link) : wire.link) : machine.select(wire.distance)),
});
const hour = new Hour(at("tape"), at("hour-chart"), at("scrub"), links);
const parts = [machine, links, budget, gauges];
const past = new Past((event) => page.frozen && showPast(event, event?.unix_s ?? hour.at_s));
// Stands for a missing setpoint, so that old numbers disappear.
const NOTHING = { setpoint: { valid: false }, scene: null, budget: null, gauges: null };

function begin(description) {
  page.machine = description;
  if (!description) return;
  document.title = `${description.machine} · compd`;
  at("machine-name").textContent = description.machine;
  for (const part of parts) part.begin(description);
  hour.begin();
}

function paint() {
  requestAnimationFrame(paint);
  const behind_s = age.behind_s;
  showBanner(page, behind_s);
  const alone = behind_s > SILENT_S;
  if (page.frozen || !page.machine || (alone ? page.blank : behind_s || !page.unpainted)) return;
  page.unpainted = false;
  page.blank = alone;
  const known = !alone && page.live?.connected && page.live.setpoint;
  for (const part of parts) part.show(known ? page.live : NOTHING);
}

// All parts at `at_s`; `event` is null if unknown.
function showPast(event, at_s) {
  const minute = { at_s, traces: event?.traces ?? gauges.traces.copy(), ...hour.minute(at_s) };
  for (const part of parts) part.show(event?.setpoint ? event : NOTHING, minute);
  showMoment(event, at_s);
}

function take(message, late_s) {
  page.unpainted = true;
  if (late_s && late_s >= LATE_S) return;
  links.note(message);
  hour.note(message);
  gauges.note(message);
}

function takeSlow(message) {
  drawer.made?.show(message);
  if (page.frozen || !message.status) return;
  showTiming(at("timing"), message.status);
  gauges.count(message.faults);
  gauges.lack(message.status.not_measured ?? []);
}

// Freeze at `at_s`, whose `event` is known or requested; or go on.
export function freeze(frozen, at_s, event) {
  if (frozen && !page.frozen) at("loop-note").textContent = `As it was when the page was frozen, ${clock(Date.now() / 1000)}. ${NOT_KEPT}`;
  page.frozen = frozen;
  page.blank = false;
  at("frozen").hidden = at("loop-note").hidden = at("thaw").hidden = !frozen;
  at("freeze").hidden = at("live-moment").hidden = frozen;
  document.body.toggleAttribute("data-frozen", frozen);
  past.leave();
  if (!frozen) hour.follow();
  else if (event) showPast(event, at_s);
  else past.ask(at_s);
}

// the banner stays in sight, whatever is drawn over the page
new ResizeObserver(() => document.documentElement.style.setProperty("--top", `${at("top").offsetHeight}px`)).observe(at("top"));
at("role").addEventListener("click", () => drawer.toggle());
at("remedy-order").addEventListener("click", ({ currentTarget: { dataset } }) => drawer.ask(dataset.order, dataset.subject));
document.addEventListener("freeze", (event) => freeze(true, event.detail.at_s, event.detail.event));
bindKeys({ page, machine, hour, drawer, freeze });
listen(page, age, { machine: begin, live: take, slow: takeSlow });
paint();
page.parts = { machine, links, budget, gauges, hour };
window.compd = page; // for tests and inspection
