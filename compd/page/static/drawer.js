// Orders and recordings, beside the machine.
import { ago, element } from "./format.js";
import { ModelList } from "./model_list.js";
import { firstStep } from "./order_names.js";
import { Orders } from "./orders.js";
import { Recordings } from "./recordings.js";

// The address as a picture for the camera of another device, which then asks for a token of its own.
function elsewhere() {
  if (["127.0.0.1", "localhost"].includes(location.hostname)) return []; // unreachable for other devices
  const code = element("img", { src: "/address.svg", alt: `QR code of ${location.origin}`, loading: "lazy", width: 180 });
  return [element("p", {}, "Open it on another device, with a token of its own: ", element("b", {}, location.origin)), code];
}

export class Drawer {
  constructor(place, page) {
    Object.assign(this, { place, page, orders: new Orders(page) });
    this.models = new ModelList();
    this.recordings = new Recordings(page, (text) => this.orders.say(text));
    this.build();
  }

  get open() {
    return !this.place.hidden;
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
    const order = (name, subject, id = name) => button(firstStep(name, subject()), () => this.ask(name, subject()), { id: `order-${id}` });
    const chosen = () => this.models.chosen;
    this.looking = element("ul");
    this.place.replaceChildren(
      element("div", { class: "row head" }, element("h2", {}, "Orders"), button("Close (Esc)", () => this.toggle())),
      element("p", { class: "note" }, "The page is read-only until you arm it. Every viewer sees who is armed."),
      element("div", { class: "row" }, this.orders.arm),
      element("div", { class: "row" }, order("zero", () => ""), order("accept", () => "all")),
      element("h3", {}, "Model"),
      ...this.models.parts,
      element("div", { class: "row" }, button(firstStep("shadow", "a model"), () => this.ask("shadow", chosen()), { id: "order-shadow" }), order("shadow", () => "", "no-shadow"), button(firstStep("adopt"), () => this.ask("adopt", chosen()), { id: "order-adopt" }), order("no-model", () => "")),
      this.orders.consequence,
      this.orders.answer,
      element("h2", {}, "Who is looking"),
      this.looking,
      element("h2", {}, "Recordings"),
      ...this.recordings.parts,
      element("h2", {}, "This browser"),
      ...elsewhere(),
      element("form", { method: "post", action: "/leave", class: "row" }, element("button", { id: "leave" }, "Leave this page"), element("span", { class: "note" }, "This browser then needs a token again.")),
    );
  }

  ask(name, subject) {
    if (!this.open) this.toggle();
    return this.orders.ask(name, subject);
  }

  // The slow event.
  show(event) {
    this.orders.show();
    this.orders.askAgain();
    this.looking.replaceChildren(...event.browsers.map((browser) => element("li", {}, `${browser.name}, ${browser.address}, ${browser.role === "view" ? "looks only" : browser.armed_s ? `ARMED, ${Math.ceil(browser.armed_s)} s left` : "not armed"}, for ${ago(browser.connected_s)}`)));
    this.recordings.show(event, this.open);
    const models = JSON.stringify(event.status?.model);
    if (this.open && this.running !== models) this.models.list();
    this.running = models;
  }
}
