// The way of joining rows, the result of its trial, and a picture of that.
import { Check, Choice, Quantity, Text } from "./fields.js";
import { AgreementPicture } from "./agreement.js";
import { OrderPicture } from "./order.js";

const BY = { time: "time, on one clock", order: "order of measuring", name: "names of points", distance: "distances alone" };

export class Putting {
  constructor(wizard, { fields, note, button, result, canvas, pictureNote }) {
    Object.assign(this, { wizard, note, button, result, canvas, pictureNote });
    this.fields = {
      by: new Choice(wizard, "by", "Put together by", Object.entries(BY)),
      plan: new Choice(wizard, "plan", "Plan that was measured"),
      frame: new Choice(wizard, "frame", "Frame of x, y, z", [["machine", "the machine's, {M}"]]),
      sigma_um: new Quantity(wizard, "sigma_um", "Standard uncertainty, µm", "not known"),
      sigma_urad: new Quantity(wizard, "sigma_urad", "… of the attitude, µrad", "not known"),
      link: new Quantity(wizard, "link", "The link that it measures", "1 …", 1),
      ball: new Quantity(wizard, "ball", "or the fixed ball, from 1", "1 …", 1),
      reflectors: new Text(wizard, "reflectors", "Places of the reflectors from the tip, mm", "A=60,0,-15; B=…"),
      offset_s: new Quantity(wizard, "offset_s", "Clock offset, s", "from the motion"),
      moving: new Check(wizard, "moving", "rows in motion too"),
    };
    fields.replaceChildren(...Object.values(this.fields).map((field) => field.label));
    button.addEventListener("click", () => wizard.try());
    this.pictures = { time: new AgreementPicture(canvas), rest: new OrderPicture(canvas) };
    addEventListener("resize", () => this.draw());
  }

  show({ table, log, choices, trial, sources }) {
    this.button.disabled = !table?.points || !(choices.recording || log?.points);
    if (sources) this.fields.plan.options(sources.plans.map((name) => [name, name]), "none: names are ids of the recording");
    if (table) this.offer(table, choices);
    if (trial === this.shown) return;
    this.shown = trial;
    this.result.hidden = !trial;
    this.result.className = trial?.reason ? "refused" : "";
    this.result.textContent = trial ? trial.reason || trial.lines.join("\n") : "";
    this.draw();
  }

  offer(table, choices) {
    const { by, plan, frame, sigma_urad, link, ball, reflectors, offset_s, moving } = this.fields;
    const chosen = choices.by || table.by;
    const length = table.axes.includes("length");
    by.automatic(table.by ? `detected: ${BY[table.by]}` : "choose …");
    frame.automatic("the instrument's own, fitted");
    frame.offer(!length);
    plan.offer(chosen === "name");
    sigma_urad.offer(table.axes.includes("rx") && chosen === "time");
    link.offer(length);
    ball.offer(length && chosen === "time");
    reflectors.offer(table.roles.includes("reflector") && chosen !== "time");
    offset_s.offer(chosen === "time");
    moving.offer(chosen === "time");
    const sigma = choices.sigma_um == null ? "Without a standard uncertainty, the noise floor is that of repeated rows; where no row is repeated, it is only estimated." : "";
    this.note.textContent = [choices.by ? "" : table.by_not_clear, sigma].filter(Boolean).join("\n");
  }

  draw() {
    const { trial } = this.wizard;
    const kind = ["time", "rest"].find((name) => trial?.[name]);
    this.canvas.hidden = !kind;
    this.pictureNote.textContent = kind ? this.pictures[kind].draw(trial[kind]) : "";
    this.canvas.setAttribute("aria-label", this.pictureNote.textContent || "Nothing is tried yet");
  }
}
