// Orders and recordings. An order is given in two steps: its consequence in numbers, then the order itself.
import { ago, dateText, element } from "./format.js";

async function post(path, keys) {
  const response = await fetch(path, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(keys) });
  const told = await response.json().catch(() => ({}));
  return { ok: response.ok, ...told };
}

const WHAT_IS_ORDERED = { zero: "Take machine zero", accept: "Accept gauges", shadow: "Run as a shadow", adopt: "Adopt the shadow's model", "no-model": "Run without effects" };

export class Drawer {
  constructor(place, page) {
    Object.assign(this, { place, page, consequence: element("div"), said: element("p", { class: "said", role: "status" }) });
    this.build();
  }

  get open() {
    return !this.place.hidden;
  }

  toggle() {
    this.place.hidden = !this.place.hidden;
    if (this.open) {
      this.list();
      this.place.querySelector("button").focus();
    }
  }

  build() {
    const button = (text, onclick, more = {}) => element("button", { type: "button", onclick, ...more }, text);
    this.arm = button("Arm for 60 s", () => this.armOrNot(), { id: "arm" });
    this.file = element("input", { type: "text", placeholder: "/path/of/a.model.yaml", "aria-label": "Model file on the daemon's computer" });
    this.name = element("input", { type: "text", placeholder: "name of a recording", "aria-label": "Name of the recording" });
    this.record = button("Record", () => this.startOrStop(), { id: "record" });
    this.looking = element("ul");
    this.parts = element("tbody");
    this.where = element("p", { class: "note" });
    this.recorded = element("p", { class: "note" });
    this.command = element("code", { class: "command" });
    this.place.replaceChildren(
      element("div", { class: "row" }, element("h2", {}, "Orders"), button("Close (Esc)", () => this.toggle())),
      element("p", { class: "note" }, "The page only looks until you arm it. Everybody who looks sees who is armed."),
      element("div", { class: "row" }, this.arm),
      element("div", { class: "row" }, ...["zero", "accept"].map((name) => button(WHAT_IS_ORDERED[name], () => this.ask(name, name === "accept" ? "all" : ""), { id: `order-${name}` }))),
      element("div", { class: "row" }, this.file),
      element("div", { class: "row" }, ...["shadow", "adopt", "no-model"].map((name) => button(WHAT_IS_ORDERED[name], () => this.ask(name, this.file.value.trim()), { id: `order-${name}` }))),
      this.consequence,
      this.said,
      element("h2", {}, "Who is looking"),
      this.looking,
      element("h2", {}, "Recordings"),
      element("div", { class: "row" }, this.name, this.record, button("Burst of 5 s", () => this.begin(5), { id: "burst" })),
      this.recorded,
      this.where,
      this.command,
      element("table", {}, this.parts),
    );
  }

  async armOrNot() {
    const armed = (this.page.armed_until ?? 0) > performance.now() / 1000;
    const told = await post("arm", { id: this.page.id, arm: !armed });
    if (!told.ok) return this.say(told.reason);
    this.page.armed_until = performance.now() / 1000 + told.armed_s;
    this.say(armed ? "Not armed any more." : "");
  }

  // First step: what the order will do.
  async ask(name, subject) {
    if (!this.open) this.toggle();
    const response = await fetch(`orders/${name}?subject=${encodeURIComponent(subject)}`);
    const told = await response.json();
    this.say("");
    const give = element("button", { type: "button", id: "confirm", onclick: () => this.give(name, subject) }, WHAT_IS_ORDERED[name]);
    give.disabled = !told.possible;
    this.consequence.replaceChildren(
      element("div", { class: "consequence" }, element("b", {}, WHAT_IS_ORDERED[name]), element("p", {}, told.text), element("code", {}, told.command), give, " ", element("button", { type: "button", onclick: () => this.consequence.replaceChildren() }, "Leave it")),
    );
  }

  // Second step: the order.
  async give(name, subject) {
    if ((this.page.armed_until ?? 0) < performance.now() / 1000) return this.say("Arm the page first.");
    this.say("…");
    const told = await post(`orders/${name}`, { id: this.page.id, subject });
    if (told.value === "zero_differs") {
      this.say(told.reason);
      const replace = element("button", { type: "button", onclick: () => this.give("zero", "replace") }, "It is the zero position: take it");
      this.consequence.replaceChildren(element("div", { class: "consequence" }, element("p", {}, told.reason), replace));
      return;
    }
    this.consequence.replaceChildren();
    this.say(told.ok ? `Done: ${WHAT_IS_ORDERED[name].toLowerCase()}.` : `Refused: ${told.reason}`);
  }

  say(text) {
    this.said.textContent = text ?? "";
  }

  async startOrStop() {
    if (this.page.slow?.recording) {
      await post("recordings", { stop: true });
      this.list();
    } else this.begin(null);
  }

  async begin(burst_s) {
    const told = await post("recordings", { name: this.name.value.trim(), burst_s });
    this.say(told.ok ? "" : told.reason);
    this.list();
  }

  async list() {
    const told = await (await fetch("recordings")).json();
    this.where.textContent = `in ${told.directory}`;
    this.command.textContent = told.command;
    this.parts.replaceChildren(
      ...told.parts.map((part) =>
        element("tr", {}, element("td", {}, element("a", { href: `recordings/${part.name}`, download: true }, part.name)), element("td", { class: "number" }, `${(part.bytes / 1e6).toFixed(2)} MB`), element("td", {}, dateText(new Date(part.changed)))),
      ),
    );
  }

  show({ browsers, recording, last_words }) {
    const armed = (this.page.armed_until ?? 0) > performance.now() / 1000;
    this.arm.textContent = armed ? "Disarm" : "Arm for 60 s";
    this.arm.disabled = this.page.role !== "operate";
    for (const name of ["record", "burst"]) this.place.querySelector(`#${name}`).disabled = this.page.role !== "operate" || (name === "burst" && Boolean(recording));
    this.looking.replaceChildren(...browsers.map((browser) => element("li", {}, `${browser.name}, ${browser.address}, ${browser.role === "view" ? "looks only" : browser.armed_s ? `ARMED, ${Math.ceil(browser.armed_s)} s left` : "not armed"}, for ${ago(browser.connected_s)}`)));
    this.record.textContent = recording ? `Stop ${recording.name}` : "Record";
    if (this.recording && !recording && this.open) this.list();
    this.recording = recording;
    this.recorded.textContent = last_words || (recording ? `recording ${recording.name} since ${dateText(new Date(recording.started * 1000))}` : "");
  }
}
