// Reading of the machine's own log: its first rows, what each column is in a recording, and in which unit.
import { element, micro } from "../format.js";
import { Columns } from "./columns.js";
import { Check, Choice } from "./fields.js";

const UNITS = { mm: ["mm", "um", "m", "cm", "inch", "ft"], um: ["um", "mm", "nm", "m", "inch"], rad: ["rad", "mrad", "deg", "arcsec"], s: ["s", "ms", "us", "min", "h", "day"], N: ["N", "kN", "kgf"], hPa: ["hPa", "Pa", "kPa", "mbar"] };
const bare = (role) => role.replace(/:.*/, "");
const unitOf = (role) => (role.includes(":") ? role.replace(/.*:/, "") : "");

export class LogReading extends Columns {
  constructor(wizard, { panel, fields, ...parts }) {
    super(wizard, parts, "log_columns", "log-");
    this.panel = panel;
    this.fields = {
      shape: new Choice(wizard, "log_shape", "Shape"),
      decimal: new Choice(wizard, "log_decimal", "Decimal sign", [[".", "point"], [",", "comma"]]),
      dates: new Choice(wizard, "log_dates", "Order of dates", [["dmy", "day month year"], ["mdy", "month day year"], ["ymd", "year month day"]]),
      angles: new Choice(wizard, "log_angles", "What the angles are"),
      clock_set_back: new Check(wizard, "log_clock_set_back", "the clock was set back by 1 h meanwhile"),
      sheet: new Choice(wizard, "log_sheet", "Sheet"),
    };
    fields.replaceChildren(...Object.values(this.fields).map((field) => field.label));
  }

  show({ sources, log, choices }) {
    this.panel.hidden = !choices.log;
    if (sources && !this.formats) {
      this.formats = sources.formats;
      this.fields.shape.options(this.formats, "detected");
      this.fields.angles.options(sources.angles, "choose …");
    }
    for (const field of Object.values(this.fields)) if (choices[field.key] == null && field.control !== document.activeElement) field.clear();
    if (log === this.shown) return;
    this.shown = log;
    this.showWhole(log, "choose a log");
    if (!log) return;
    const roles = this.columns(log);
    const has = (start) => roles.some((role) => role.startsWith(start));
    this.fields.shape.automatic(`detected: ${this.formats.find(([name]) => name === log.shape)?.[1] ?? "not known"}`);
    this.fields.dates.offer(has("time_s") || choices.log_dates != null);
    this.fields.clock_set_back.offer(has("time_s"));
    this.fields.angles.offer(has("commanded_r"));
    this.fields.sheet.offer(log.sheets.length > 1);
    this.fields.sheet.options(log.sheets.map((name) => [name, name]), "the one with numbers");
  }

  // The role, and the unit where a header may have none.
  roleOf(role, k) {
    const name = bare(role);
    const names = this.shown.names.includes(name) || name === "-" ? this.shown.names : [name, ...this.shown.names];
    const list = this.roleList(k, [["-", "unused"], ...names.map((known) => [known, known])], name);
    const units = UNITS[name.replace(/.*_/, "")];
    if (!units) return list;
    const options = [["", "unit: as its name says"], ...units.map((unit) => [unit, micro(unit)])];
    const unit = element("select", { id: `log-unit-${k}`, "aria-label": `Unit of column ${k + 1}` }, ...options.map(([value, text]) => element("option", { value, selected: value === unitOf(role) }, text)));
    unit.addEventListener("change", () => this.change(k, unit.value ? `${name}:${unit.value}` : name));
    return element("span", { class: "roles" }, list, unit);
  }

  // A role of another column is taken from it, since each is unique.
  change(k, role) {
    const columns = this.columns(this.wizard.log).map((own) => (role !== "-" && bare(own) === bare(role) ? "-" : own));
    columns[k] = role;
    this.wizard.change({ log_columns: columns });
  }
}
