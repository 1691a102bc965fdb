// Orders and recordings. An order is given in two steps: its consequence in numbers, then the order itself.
import { CommandLine } from "./command_line.js";
import { ago, element } from "./format.js";
import { ModelList } from "./model_list.js";
import { post } from "./post.js";
import { Recordings } from "./recordings.js";

const WHAT_IS_ORDERED = { zero: "Take machine zero", accept: "Accept gauges", shadow: "Run as a shadow", adopt: "Adopt the shadow's model", "no-model": "Run without effects" };

function nameOf(order, subject) {
  return order === "shadow" && !subject ? "End the shadow" : WHAT_IS_ORDERED[order];
}

export class Drawer {
  constructor(place, page) {
    Object.assign(this, { place, page, consequence: element("div"), said: element("p", { class: "said", role: "status" }) });
    this.models = new ModelList();
    this.recordings = new Recordings(page, (text) => this.say(text));
    this.build();
  }

  get open() {
    return !this.place.hidden;
  }

  get armed() {
    return (this.page.armed_until ?? 0) > performance.now() / 1000;
  }

  toggle() {
    if (this.open) {
      document.activeElement.blur(); // a hidden button would still take the next key
      this.opener?.focus();
      this.place.hidden = true;
      return;
    }
    this.opener = document.activeElement;
    this.place.hidden = false;
    this.models.list();
    this.recordings.list();
    this.place.querySelector("button").focus();
  }

  build() {
    const button = (text, onclick, more = {}) => element("button", { type: "button", onclick, ...more }, text);
    const order = (name, subject, id = name) => button(nameOf(name, subject()), () => this.ask(name, subject()), { id: `order-${id}` });
    const chosen = () => this.models.chosen;
    this.arm = button("Arm for 60 s", () => this.armOrNot(), { id: "arm" });
    this.looking = element("ul");
    this.place.replaceChildren(
      element("div", { class: "row head" }, element("h2", {}, "Orders"), button("Close (Esc)", () => this.toggle())),
      element("p", { class: "note" }, "The page only looks until you arm it. Everybody who looks sees who is armed."),
      element("div", { class: "row" }, this.arm),
      element("div", { class: "row" }, order("zero", () => ""), order("accept", () => "all")),
      element("h3", {}, "Model"),
      ...this.models.parts,
      element("div", { class: "row" }, button(WHAT_IS_ORDERED.shadow, () => this.ask("shadow", chosen()), { id: "order-shadow" }), order("shadow", () => "", "no-shadow"), button(WHAT_IS_ORDERED.adopt, () => this.ask("adopt", chosen()), { id: "order-adopt" }), order("no-model", () => "")),
      this.consequence,
      this.said,
      element("h2", {}, "Who is looking"),
      this.looking,
      element("h2", {}, "Recordings"),
      ...this.recordings.parts,
    );
  }

  async armOrNot() {
    const armed = this.armed;
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
    const title = nameOf(name, subject);
    // what is told is what is given: the file that a name stands for now, not later
    const give = element("button", { type: "button", id: "confirm", onclick: () => this.give(name, told.subject || subject) }, title);
    give.disabled = !told.possible;
    const leave = element("button", { type: "button", onclick: () => this.consequence.replaceChildren() }, "Leave it");
    this.tell(element("b", {}, title), element("p", {}, told.text), new CommandLine(told.command).row, element("div", { class: "row" }, give, leave));
  }

  tell(...parts) {
    const box = element("div", { class: "consequence" }, ...parts);
    this.consequence.replaceChildren(box);
    box.scrollIntoView({ block: "nearest" });
  }

  // Second step: the order.
  async give(name, subject) {
    if (!this.armed) return this.say("Arm the page first.");
    this.say("…");
    const told = await post(`orders/${name}`, { id: this.page.id, subject });
    if (told.value === "zero_differs") {
      this.say(told.reason);
      const replace = element("button", { type: "button", onclick: () => this.give("zero", "replace") }, "It is the zero position: take it");
      return this.tell(element("p", {}, told.reason), new CommandLine(told.command).row, replace);
    }
    this.consequence.replaceChildren();
    this.say(told.ok ? `Done: ${nameOf(name, subject).toLowerCase()}.` : `Refused: ${told.reason}`);
  }

  say(text) {
    this.said.textContent = text ?? "";
  }

  // The slow event.
  show(event) {
    this.arm.textContent = this.armed ? "Disarm" : "Arm for 60 s";
    this.arm.disabled = this.page.role !== "operate";
    this.looking.replaceChildren(...event.browsers.map((browser) => element("li", {}, `${browser.name}, ${browser.address}, ${browser.role === "view" ? "looks only" : browser.armed_s ? `ARMED, ${Math.ceil(browser.armed_s)} s left` : "not armed"}, for ${ago(browser.connected_s)}`)));
    this.recordings.show(event, this.open);
    const models = JSON.stringify(event.status?.model);
    if (this.open && this.running !== models) this.models.list();
    this.running = models;
  }
}
