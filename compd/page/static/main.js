// The page: takes the events, paints the newest of them once a frame, and never an old one as the present.
import { Age } from "./age.js";
import { showBanner } from "./banner.js";
import { Budget } from "./budget.js";
import { Drawer } from "./drawer.js";
import { Gauges } from "./gauges.js";
import { Hour } from "./hour.js";
import { bindKeys } from "./keys.js";
import { Links } from "./links.js";
import { Machine } from "./machine.js";
import { showTiming } from "./timing.js";

export const page = { live: null, slow: null, machine: null, id: "", role: "view", frozen: false, selected: 0, unpainted: false };
const age = new Age();
const at = (id) => document.getElementById(id);

const drawer = new Drawer(at("drawer"), page);
const machine = new Machine(at("scene"), at("colours"), page);
const links = new Links(at("strips"), page);
const budget = new Budget(at("budget"), page);
const gauges = new Gauges(at("gauge-table"), at("gauges-summary"), drawer);
const hour = new Hour(at("tape"), at("hour-chart"), at("scrub"), links);

function begin(told) {
  page.machine = told;
  if (!told) return;
  document.title = `${told.machine} · compd`;
  at("machine-name").textContent = told.machine;
  for (const part of [machine, links, budget, gauges]) part.begin(told);
  hour.begin();
}

function paint() {
  requestAnimationFrame(paint);
  const behind_s = age.behind_s;
  showBanner(page, behind_s);
  if (!page.unpainted || page.frozen || behind_s) return;
  page.unpainted = false;
  if (!page.live?.connected || !page.live.setpoint) return;
  for (const part of [machine, links, budget, gauges]) part.show(page.live);
}

function listen() {
  const source = new EventSource("live");
  const on = (name, take) => source.addEventListener(name, (event) => take(JSON.parse(event.data)));
  on("hello", (told) => {
    age.begin();
    [page.id, page.role] = [told.id, told.role];
    begin(told.machine);
  });
  on("machine", (told) => begin(told.machine));
  on("live", (told) => {
    const late_s = age.arrived(told.made);
    page.live = told;
    page.unpainted = true;
    if (!late_s || late_s < 0.5) {
      links.note(told);
      hour.note(told);
    }
  });
  on("slow", (told) => {
    page.slow = told;
    drawer.show(told);
    if (page.frozen || !told.status) return;
    showTiming(at("timing"), told.status);
    gauges.count(told.status);
  });
}

export function freeze(frozen, at_s) {
  page.frozen = frozen;
  at("frozen").hidden = !frozen;
  if (frozen) at("frozen-at").textContent = new Date(at_s * 1000).toTimeString().slice(0, 8);
  else hour.follow();
}

at("thaw").addEventListener("click", () => freeze(false));
at("role").addEventListener("click", () => drawer.toggle());
document.addEventListener("freeze", (event) => freeze(event.detail.frozen, event.detail.at_s));
bindKeys({ page, machine, hour, drawer, freeze });
listen();
paint();
window.compd = page; // for tests, and for the curious
