// A past moment as a whole: the event stored by the page's server. While keys scrub faster than the server answers,
// only the newest request is sent.
import { tipText } from "./format.js";
import { appearance, stateName } from "./states.js";

const at = (id) => document.getElementById(id);
export const NOT_KEPT = "Timing of the loop, clients and counts of faults are not kept.";

// Resolution of a tenth of a second, that of the stored last minute.
export const clock = (time_s) => {
  const tenths = Math.floor(time_s * 10);
  return `${new Date(tenths * 100).toTimeString().slice(0, 8)}.${tenths % 10}`;
};

export class Past {
  constructor(take) {
    Object.assign(this, { take, wanted_s: null, busy: false });
  }

  // Request the moment `time_s`; `take(event)` gets it, or null if unknown.
  async ask(time_s) {
    this.wanted_s = time_s;
    if (this.busy) return;
    this.busy = true;
    while (this.wanted_s !== null) {
      const asked_s = this.wanted_s;
      const asked = (path) => fetch(`${path}?unix_s=${asked_s}`).then((answer) => (answer.ok ? answer.json() : null)).catch(() => null);
      const [event, traces] = await Promise.all([asked("moment"), asked("traces")]);
      if (event) event.traces = traces ?? { times_s: [], values: [] };
      if (this.wanted_s === asked_s) {
        this.wanted_s = null;
        this.take(event);
      }
    }
    this.busy = false;
  }

  // Ignore an answer that is no longer wanted.
  leave() {
    this.wanted_s = null;
  }
}

// The line under the banner: the shown moment and its state, since the banner stays with the present one.
export function showMoment(event, at_s) {
  at("frozen-at").textContent = clock(at_s);
  const setpoint = event?.setpoint;
  const sign = setpoint ? appearance(setpoint.state)[1] : "⚡";
  const state = setpoint ? stateName(setpoint.state) : event ? "NO DAEMON" : "NO DATA";
  const tip = setpoint?.valid ? `  tip ${tipText(setpoint.tip_M_mm)}` : "";
  at("frozen-state").textContent = `${sign} ${state}${tip}`;
  at("frozen-reason").textContent = setpoint?.reason ?? event?.reason ?? "";
}
