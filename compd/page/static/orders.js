// Orders of a browser that is armed. An order is given in two steps: its consequence in numbers, then the order itself.
import { CommandLine } from "./command_line.js";
import { element } from "./format.js";
import { nameOf } from "./order_names.js";
import { post } from "./post.js";

export class Orders {
  // page: {id, role, armed_until} of this browser's connection; confirm: id of the button of the second step
  constructor(page, confirm = "confirm") {
    Object.assign(this, { page, confirm, consequence: element("div"), answer: element("p", { class: "order-answer", role: "status" }) });
    this.arm = element("button", { type: "button", id: "arm", onclick: () => this.armOrNot() }, "Arm for 60 s");
  }

  get armed() {
    return (this.page.armed_until ?? 0) > performance.now() / 1000;
  }

  async armOrNot() {
    const armed = this.armed;
    const answer = await post("arm", { id: this.page.id, arm: !armed });
    if (!answer.ok) return this.say(answer.reason);
    this.page.armed_until = performance.now() / 1000 + answer.armed_s;
    this.say(armed ? "Not armed any more." : "");
    this.show();
  }

  // First step: the consequence of the order.
  async ask(name, subject) {
    this.say("");
    this.impossible = null;
    this.question = { name, subject };
    await this.inform(this.question);
  }

  // Check again whether the order is possible: called at news from the daemon.
  async askAgain() {
    if (this.impossible) await this.inform(this.question);
  }

  // impossible : reason why the present order cannot be given; null if it can.
  async inform(question) {
    const { name, subject } = question;
    const response = await fetch(`orders/${name}?subject=${encodeURIComponent(subject)}`);
    const consequence = await response.json();
    // ignore an answer after another question, or after leaving this one
    if (question !== this.question || consequence.text === this.impossible) return;
    this.impossible = consequence.possible ? null : consequence.text;
    const title = nameOf(name, subject);
    // the shown order is the one given: an adopted shadow is the model with this hash
    const give = element("button", { type: "button", id: this.confirm, onclick: () => this.give(name, consequence.subject || subject) }, title);
    give.disabled = !consequence.possible;
    this.showConsequence(element("b", {}, title), element("p", {}, consequence.text), new CommandLine(consequence.command).row, element("div", { class: "row" }, give, element("button", { type: "button", onclick: () => this.leave() }, "Leave it")));
  }

  showConsequence(...parts) {
    const box = element("div", { class: "consequence" }, ...parts);
    this.consequence.replaceChildren(box);
    box.scrollIntoView({ block: "nearest" });
  }

  leave() {
    this.question = null;
    this.impossible = null;
    this.consequence.replaceChildren();
  }

  // Second step: the order.
  async give(name, subject) {
    if (!this.armed) return this.say(this.page.role === "operate" ? "Arm the page first." : "This browser is read-only.");
    this.say("…");
    this.question = null;
    const answer = await post(`orders/${name}`, { id: this.page.id, subject });
    if (answer.value === "zero_differs") {
      const { command } = await (await fetch("orders/zero?subject=replace")).json();
      this.say(answer.reason);
      const replace = element("button", { type: "button", onclick: () => this.give("zero", "replace") }, "It is the zero position: take it");
      return this.showConsequence(element("p", {}, answer.reason), new CommandLine(command).row, replace);
    }
    this.leave();
    const believed = Object.entries(answer.answer?.believed_for_s ?? {}).map(([channel, seconds]) => ` ${channel}: believed for ${seconds.toFixed(1)} s.`);
    this.say(answer.ok ? `Done: ${nameOf(name, subject).toLowerCase()}.${believed.join("")}` : `Refused: ${answer.reason}`);
    if (answer.ok && ["adopt", "no-model"].includes(name)) this.offerToKeep(answer.answer);
  }

  // For an applied model: whether the daemon starts with it again, and the line of its configuration for that.
  offerToKeep({ applied, kept, kept_text: text }) {
    const line = kept || !applied.file ? "" : text.split("`")[1];
    this.showConsequence(element("p", {}, `The model is ${text}.`), new CommandLine(line, "Copy this line").row);
  }

  say(text) {
    this.answer.textContent = text ?? "";
  }

  // Whether this browser is armed now.
  show() {
    this.arm.textContent = this.armed ? "Disarm" : "Arm for 60 s";
    this.arm.disabled = this.page.role !== "operate";
  }
}
