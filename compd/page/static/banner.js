// State and reason in words, on top of everything; outdated ones are grey.
import { SILENT_S } from "./age.js";
import { ago, isKnown, tipText } from "./format.js";
import { firstStep } from "./order_names.js";
import { remedyOf } from "./remedy.js";
import { appearance, stateName } from "./states.js";

const at = (id) => document.getElementById(id);
let shown = "";

// State of the daemon, the worst of the last seconds, and of this page's own connection, in words.
export function describe(page, behind_s) {
  const live = page.live;
  if (!live || behind_s > SILENT_S) {
    const text = live ? `no news from the page's server for ${ago(behind_s)}` : "waiting for the page's server";
    return { state: "gone", tone: "gone", sign: "⚡", name: "NOT CONNECTED", reason: text };
  }
  if (behind_s) return { state: "late", tone: "gone", sign: "⏲", name: "LATE", reason: `events are ${ago(behind_s)} old` };
  if (!live.connected || !live.setpoint) {
    return { state: "gone", tone: "gone", sign: "⚡", name: "NO DAEMON", reason: live.reason || "it has told nothing yet" };
  }
  const { state, reason, count } = page.latch.worst;
  const [tone, sign] = appearance(state);
  return { state, tone, sign, name: `${stateName(state)}${count > 1 ? ` ×${count}` : ""}`, reason };
}

function write(id, text) {
  const target = at(id);
  if (target.textContent !== text) target.textContent = text;
}

export function showBanner(page, behind_s) {
  const summary = describe(page, behind_s);
  const key = summary.state + summary.tone;
  if (key !== shown) {
    shown = key;
    document.body.dataset.state = summary.state;
    document.body.dataset.tone = summary.tone;
  }
  write("sign", summary.sign);
  write("state", summary.name);
  write("reason", summary.reason);
  if (at("reason").title !== summary.reason) at("reason").title = summary.reason;
  showRemedy(remedyOf(page, summary), page.role === "operate");
  const setpoint = summary.tone === "gone" ? null : page.live.setpoint;
  write("mode", setpoint ? (setpoint.mode === "cmm" ? "measuring (cmm)" : "machine tool") : "");
  write("tip", setpoint?.valid ? tipText(setpoint.tip_M_mm, setpoint.u_tip_um) : "");
  const skew = setpoint?.skew_s === undefined ? "" : `, skew ${ago(setpoint.skew_s)}`;
  write("age", setpoint?.valid ? `oldest gauge ${ago(setpoint.age_s)}${skew}${isKnown(setpoint.u_tip_um) ? "" : "; bound of its error unknown"}` : "");
  const own = page.slow?.browsers ?? [];
  const armed = own.filter((browser) => browser.armed_s > 0);
  write("connected", own.length ? `${own.length} looking${armed.length ? `, ${armed.map((b) => b.name).join(", ")} armed` : ""}` : "");
  const left_s = Math.max(0, (page.armed_until ?? 0) - performance.now() / 1000);
  write("role", left_s ? `Orders: armed ${ago(left_s).replace(" min", "")}` : page.role === "operate" ? "Orders" : "Orders: view only");
  at("role").classList.toggle("armed", left_s > 0);
}

// A browser that may only look is told who can do it instead.
function showRemedy({ text, order, subject }, mayOrder) {
  write("remedy", order && !mayOrder ? `${text} A browser with the role operate can do it: “${firstStep(order, subject)}”.` : text);
  const button = at("remedy-order");
  button.hidden = !order || !mayOrder;
  if (button.hidden) return;
  Object.assign(button.dataset, { order, subject });
  write("remedy-order", firstStep(order, subject));
}
