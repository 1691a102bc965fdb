// Reading of the export: its first rows, the role of each column, and further options.
import { element, micro } from "../format.js";
import { Columns } from "./columns.js";
import { Check, Choice, Quantity } from "./fields.js";

const ROLES = [["time", "time"], ["time[s]", "time, s"], ["time[ms]", "time, ms"], ["time[min]", "time, min"], ["time[h]", "time, h"], ["time[day]", "time, days"], ["date", "date"], ["x", "x"], ["y", "y"], ["z", "z"], ["rx", "rx"], ["ry", "ry"], ["rz", "rz"], ["length", "length"], ["name", "name"], ["visit", "visit"], ["reflector", "reflector"], ["group", "group"], ["collection", "collection"], ["-", "unused"]];
const LENGTHS = ["mm", "um", "m", "cm", "inch", "ft"];
const ANGLES = ["rad", "mrad", "deg", "arcsec"];
const each = (values) => values.map((value) => [value, value]);
const units = (values) => values.map((value) => [value, micro(value)]);
const bare = (role) => role.replace(/\[.*/, "");

export class Reading extends Columns {
  constructor(wizard, { fields, ...parts }) {
    super(wizard, parts, "columns", "");
    this.fields = {
      shape: new Choice(wizard, "shape", "Shape"),
      unit: new Choice(wizard, "unit", "Unit of lengths", units(LENGTHS)),
      angle_unit: new Choice(wizard, "angle_unit", "Unit of angles", units(ANGLES)),
      angles: new Choice(wizard, "angles", "What the angles are"),
      decimal: new Choice(wizard, "decimal", "Decimal sign", [[".", "point"], [",", "comma"]]),
      dates: new Choice(wizard, "dates", "Order of dates", [["dmy", "day month year"], ["mdy", "month day year"], ["ymd", "year month day"]]),
      rate_hz: new Quantity(wizard, "rate_hz", "Rows in a second", "Hz"),
      clock_set_back: new Check(wizard, "clock_set_back", "the clock was set back by 1 h meanwhile"),
      group: new Choice(wizard, "group", "Group of points"),
      sheet: new Choice(wizard, "sheet", "Sheet"),
    };
    this.guess = element("button", { type: "button", id: "guess", onclick: () => wizard.change({ columns: null }) }, "Guess the columns again");
    // a role, as those in the table are
    this.visits = element("select", { id: "choice-visits", disabled: true, onchange: () => this.chooseVisits() }, element("option", {}, "detected"));
    this.visitsLabel = element("label", {}, "Visits", this.visits);
    fields.replaceChildren(...Object.values(this.fields).map((field) => field.label), this.visitsLabel, this.guess);
  }

  show({ sources, table, choices }) {
    if (sources && !this.formats) {
      this.formats = sources.formats;
      this.fields.shape.options(this.formats, "detected");
      this.fields.angles.options(sources.angles, "a rotation vector");
    }
    for (const field of Object.values(this.fields)) if (choices[field.key] == null && field.control !== document.activeElement) field.clear();
    this.guess.disabled = !choices.columns;
    if (table === this.shown) return;
    this.shown = table;
    this.showWhole(table, "choose an export");
    this.visits.disabled = !table;
    if (!table) return;
    this.showVisits(table, choices.by || table.by);
    const { shape, unit, angle_unit, angles, decimal, dates, rate_hz, clock_set_back, group, sheet } = this.fields;
    const { assumed } = table;
    const lengthUnit = /, (mm|µm|nm|m|cm|inch|ft)( |$)/.exec(assumed.x ?? assumed.y ?? assumed.z ?? assumed.length ?? "");
    shape.automatic(`detected: ${this.formats.find(([name]) => name === table.shape)?.[1] ?? "not known"}`);
    unit.automatic(lengthUnit && !choices.unit ? `detected: ${lengthUnit[1]}` : "as the file says");
    angle_unit.offer(table.roles.some((role) => /^r[xyz]$/.test(role)));
    angle_unit.automatic("as the file says");
    angles.offer(choices.angles != null || table.roles.some((role) => /^r[xyz]$/.test(role)) || table.problems.some((problem) => problem.includes("--angles")));
    decimal.automatic(assumed["decimal mark"] && !choices.decimal ? `detected: ${assumed["decimal mark"]}` : "detected");
    const order = /dates ([a-z]+-[a-z]+-[a-z]+)/.exec(assumed.time ?? "");
    dates.automatic(order && !choices.dates ? `detected: ${order[1].replaceAll("-", " ")}` : "detected");
    rate_hz.offer(!table.roles.includes("time"));
    clock_set_back.offer(table.roles.some((role) => bare(role) === "time"));
    group.offer(table.groups.length > 1 || choices.group != null);
    group.options([...each(table.groups), ["all", "all of them"]], table.groups.length > 1 ? "choose …" : "the only one");
    sheet.offer(table.sheets.length > 1);
    sheet.options(each(table.sheets), "the one with numbers");
  }

  // The column by which rows of one visit are known; none: those in one dwell are.
  showVisits(table, by) {
    const roles = this.columns(table);
    const columns = roles.map((_, k) => [String(k), table.header[k] || `column ${k + 1}`]);
    this.visitsLabel.hidden = by === "time";
    this.visits.replaceChildren(...[["", "the repeats in a dwell"], ...columns].map(([value, text]) => element("option", { value }, text)));
    this.visits.value = roles.includes("visit") ? String(roles.indexOf("visit")) : "";
  }

  chooseVisits() {
    const now = this.columns(this.wizard.table).indexOf("visit");
    if (this.visits.value) this.change(Number(this.visits.value), "visit");
    else if (now >= 0) this.change(now, "-");
  }

  roleOf(role, k) {
    const known = ROLES.some(([value]) => value === role) ? ROLES : [[role, role], ...ROLES];
    return this.roleList(k, known, role);
  }

  // A role of another column is exchanged, since each is unique.
  change(k, role) {
    const columns = [...this.columns(this.wizard.table)];
    const other = role === "-" ? -1 : columns.findIndex((own, i) => i !== k && bare(own) === bare(role));
    if (other >= 0) columns[other] = columns[k];
    columns[k] = role;
    this.wizard.change({ columns });
  }
}
