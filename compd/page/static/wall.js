// The state for a screen on the wall: read from some metres, without a mouse.
import { Age } from "./age.js";
import { describe } from "./banner.js";
import { dateText, tipText } from "./format.js";
import { listen } from "./live_events.js";
import { remedyOf } from "./remedy.js";

const WRITE_EVERY_MS = 200;
const page = { live: null, slow: null, machine: null };
const age = new Age();
const at = (id) => document.getElementById(id);
let since = { state: "", unix_s: 0 };

function write(id, text) {
  if (at(id).textContent !== text) at(id).textContent = text;
}

function show() {
  const summary = describe(page, age.behind_s);
  const now = new Date();
  if (since.state !== summary.state) since = { state: summary.state, text: dateText(now).slice(11) };
  Object.assign(document.body.dataset, { state: summary.state, tone: summary.tone });
  const setpoint = summary.tone === "gone" ? null : page.live.setpoint;
  const name = page.machine?.machine ?? "compd";
  document.title = `${summary.sign} ${summary.name} · ${name}`;
  write("machine-name", name);
  write("sign", summary.sign);
  write("state", summary.name);
  write("reason", summary.reason);
  write("remedy", remedyOf(page, summary).text);
  write("tip", setpoint?.valid ? `tip ${tipText(setpoint.tip_M_mm, setpoint.u_tip_um)}` : setpoint ? "no valid setpoint" : "");
  write("since", `since ${since.text} on this screen`);
  write("clock", dateText(now));
}

const took = (machine) => (page.machine = machine);
listen(page, age, { machine: took, live: () => {}, slow: () => {} });
setInterval(show, WRITE_EVERY_MS);
show();
window.compd = page; // for tests and inspection
