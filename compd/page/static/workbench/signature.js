// Signature of an effect alone: arrows with every number at the end of its plausible range.
import { amounts, element, ink, prepared } from "../format.js";
import { SpaceView, mapped } from "./space_view.js";

// Around the map, without numbers.
const MARGIN = { left: 8, right: 8, top: 8, bottom: 8 };

export class Signature {
  constructor() {
    this.canvas = element("canvas", { class: "signature", role: "img" });
    this.note = element("small", {});
    this.place = element("div", {}, this.canvas, this.note);
  }

  // trial: of the effect; card: with the plausible ranges
  show(rows, trial, card) {
    this.place.hidden = rows.labels.length !== 3;
    if (this.place.hidden) return;
    const ends = card.numbers.map(({ range }) => (Math.abs(range[1]) >= Math.abs(range[0]) ? range[1] : range[0]));
    const moved = trial.moved(ends);
    const used = (row) => rows.state[row] === 0;
    let largest = 0;
    moved.forEach((value, k) => used(Math.floor(k / 3)) && (largest = Math.max(largest, Math.abs(value))));
    const { context, width, height } = prepared(this.canvas);
    const view = new SpaceView(mapped(0, 2, MARGIN), "", "xz");
    view.layout(rows, largest, width, height);
    context.fillStyle = ink("--soft");
    view.paint(context, rows, moved, view.marks(rows), used);
    const text = `its signature from the front, numbers at the end of their plausible ranges: up to ${amounts([largest], rows.unit)}`;
    this.canvas.setAttribute("aria-label", text);
    this.note.textContent = text;
  }
}
