// The values of the row whose mark is below the pointer.
import { amounts, element } from "../format.js";
import { placeUnit } from "./space_view.js";

const NEAR_PX = 8;
// Most quantities in the text.
const MOST_QUANTITIES = 6;

export class Hover {
  // shown: () -> {rows, residual, marks, used}, or null where nothing is drawn
  constructor(canvas, shown) {
    Object.assign(this, { canvas, shown });
    this.text = element("div", { class: "row-values", hidden: true });
    canvas.after(this.text);
    canvas.addEventListener("pointermove", (event) => this.point(event));
    for (const end of ["pointerleave", "pointerdown"]) canvas.addEventListener(end, () => (this.text.hidden = true));
  }

  point({ buttons, offsetX, offsetY }) {
    const drawn = buttons ? null : this.shown();
    const nearest = drawn && this.nearest(drawn, offsetX, offsetY);
    this.text.hidden = !nearest;
    if (!nearest) return;
    this.text.textContent = rowText(drawn, nearest.row);
    const { offsetLeft, offsetTop, clientWidth } = this.canvas;
    this.text.style.left = `${offsetLeft + Math.min(offsetX + 14, clientWidth - this.text.offsetWidth)}px`;
    this.text.style.top = `${offsetTop + offsetY + 14}px`;
  }

  nearest({ rows, marks, used }, x, y) {
    const per_row = marks.length / 2 / rows.row.length;
    let found = null;
    let away = NEAR_PX;
    for (let k = 0; k < marks.length / 2; k++) {
      const distance = Math.hypot(marks[2 * k] - x, marks[2 * k + 1] - y);
      if (distance > away || !used((k / per_row) | 0)) continue;
      away = distance;
      found = { row: (k / per_row) | 0 };
    }
    return found;
  }
}

// Number, time, place and residual of a row, in lines.
function rowText({ rows, residual }, row) {
  const m = rows.labels.length;
  const [unit, per_mm] = placeUnit(rows.unit);
  const place = [...rows.place_mm.subarray(3 * row, 3 * row + 3)].map((value, k) => (Number.isFinite(value) ? `${"xyz"[k]} ${(value * per_mm).toFixed(2)}` : "")).filter(Boolean);
  const errors = (array) => rows.labels.map((name, k) => `${name} ${amounts([array[m * row + k]], rows.units[k])}`).join(", ");
  const quantities = Object.entries(rows.quantity_titles).map(([name, title]) => `${title}: ${Number(rows[name][row].toPrecision(5))}`);
  return [
    `row ${rows.row[row]}, ${rows.time_title}: ${Number(rows.time_s[row].toPrecision(6))}`,
    ...(place.length ? [`place ${place.join(", ")} ${unit}`] : []),
    `residual ${errors(rows.residual)}`,
    ...(residual === rows.residual ? [] : [`with the trial ${errors(residual)}`]),
    ...quantities.slice(0, MOST_QUANTITIES),
    ...(quantities.length > MOST_QUANTITIES ? [`and ${quantities.length - MOST_QUANTITIES} more quantities`] : []),
  ].join("\n");
}
