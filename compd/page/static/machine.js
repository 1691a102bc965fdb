// The machine in three dimensions on a plain canvas, with the errors drawn many times larger than they are.
import { ink, prepared, signedLength } from "./format.js";
import { actuatorParts, hingeParts } from "./mechanism.js";
import { Turn } from "./orbit_control.js";

const RODS = { t1: ["supports", 0, "supports", 1], t2: ["supports", 1, "supports", 2], t3: ["supports", 2, "supports", 0], u1: ["supports", 0, "plate", 0], u2: ["supports", 0, "plate", 2], u3: ["supports", 1, "plate", 0], u4: ["supports", 1, "plate", 1], u5: ["supports", 2, "plate", 1], u6: ["supports", 2, "plate", 2] };
const TRAIL_S = 10;
// Least end of the colour scale, µm: noise must not look like a movement.
const MIN_UM = 1;
const VIEWS = { f: [0, 0], s: [Math.PI / 2, 0], t: [0, Math.PI / 2 - 1e-3] };

// Blue below zero, grey at zero, vermilion above.
export function diverging(share) {
  const [from, to] = [[139, 148, 158], share < 0 ? [0, 114, 178] : [213, 94, 0]];
  const part = Math.min(1, Math.abs(share));
  return `rgb(${from.map((value, k) => Math.round(value + (to[k] - value) * part)).join()})`;
}

export class Machine {
  constructor(canvas, colours, page) {
    Object.assign(this, { canvas, colours, page, trail: [], largest_um: 1, parts: [], scene: null });
    const slider = document.getElementById("exaggeration");
    const say = () => {
      this.times = slider.value === "0" ? 1 : Math.round(10 ** slider.value);
      document.getElementById("exaggeration-text").textContent = `× ${this.times}`;
      this.draw();
    };
    slider.addEventListener("input", say);
    say();
    this.turn = new Turn(canvas, () => this.draw(), (x, y) => this.hover(x, y));
  }

  begin(machine) {
    this.trail = [];
    this.machine = machine;
    this.frame = Object.fromEntries(machine.wiring.map((wire, k) => [wire.distance, k]).filter(([distance]) => distance));
  }

  // The number of the actuator that moves a link.
  actuatorOf(link) {
    return this.machine?.mechanism?.rods[link - 1]?.actuator ?? link;
  }

  // Mark a rod of the frame, or none.
  select(rod) {
    this.rod = this.rod === rod ? null : rod;
    this.draw();
  }

  view(key) {
    this.turn.look(...VIEWS[key]);
  }

  // An event; with `minute` a past one.
  show({ scene, setpoint, gauges }, minute) {
    this.scene = scene;
    if (minute || this.past) this.trail = [];
    this.past = Boolean(minute);
    minute?.times.forEach((time_s, k) => {
      if (time_s >= minute.at_s - TRAIL_S && !Number.isNaN(minute.tips_mm[k][0])) this.trail.push([time_s, minute.tips_mm[k]]);
    });
    if (scene) {
      this.corrections_um = setpoint.correction_mm.map((value) => value * 1000);
      this.rods_um = Object.fromEntries(Object.entries(this.frame ?? {}).map(([name, k]) => [name, gauges[k].fault || gauges[k].value === undefined ? null : gauges[k].value * 1000]));
      const largest = Math.max(...this.corrections_um.map(Math.abs), ...Object.values(this.rods_um).map((value) => Math.abs(value ?? 0)), MIN_UM);
      if (!document.getElementById("lock").checked) this.largest_um = largest;
      this.trail.push([minute?.at_s ?? setpoint.time_s, scene.tip]);
      while (!minute && this.trail.length && this.trail[0][0] < setpoint.time_s - TRAIL_S) this.trail.shift();
    }
    this.draw();
  }

  draw() {
    const { context, width, height } = prepared(this.canvas);
    this.parts = [];
    if (!this.scene || !this.machine?.mechanism) {
      context.fillStyle = ink("--soft");
      context.font = "13px system-ui";
      const own = this.machine && !this.machine.mechanism;
      context.fillText(own ? "own kinematics: where its parts are is not known" : "no valid setpoint: position of the machine unknown", 12, 24);
      return;
    }
    const { plate, supports, base, platform, tip, supports_moved_um, tip_moved_um } = this.scene;
    const { mechanism } = this.machine;
    const actuators = actuatorParts(this.machine, this.scene);
    const place = this.turn.projector([...plate, ...supports, ...base, ...platform, tip, ...actuators.flatMap(({ points }) => points)].flat(), width, height);
    const ghost = (point, moved_um) => point.map((value, k) => value - (moved_um[k] * this.times) / 1000);
    const line = (points, colour, thick, dash = []) => {
      context.beginPath();
      points.map(place).forEach(([x, y], k) => (k ? context.lineTo(x, y) : context.moveTo(x, y)));
      context.strokeStyle = colour;
      context.lineWidth = thick;
      context.setLineDash(dash);
      context.stroke();
      context.setLineDash([]);
    };
    const fill = (points, colour) => {
      if (!points.length) return;
      context.beginPath();
      points.map(place).forEach(([x, y], k) => (k ? context.lineTo(x, y) : context.moveTo(x, y)));
      context.closePath();
      context.fillStyle = colour;
      context.fill();
    };
    fill(plate, "#8c959f33");
    if (plate.length) line([...plate, plate[0]], ink("--soft"), 1);
    const old = { supports: supports.map((point, k) => ghost(point, supports_moved_um[k])), platform: platform.map((point) => ghost(point, tip_moved_um)), tip: ghost(tip, tip_moved_um) };
    const faint = "#8c959f99";
    if (supports.length) line([...old.supports, old.supports[0]], faint, 1, [4, 4]);
    line([...old.platform, old.platform[0]], faint, 1, [4, 4]);
    old.platform.forEach((point) => line([point, old.tip], faint, 1, [4, 4]));
    for (const [name, [from, i, to, k]] of supports.length ? Object.entries(RODS) : []) {
      const um = this.rods_um?.[name];
      const ends = [this.scene[from][i], this.scene[to][k]];
      if (this.rod === name) line(ends, ink("--ink"), 6);
      line(ends, um === null || um === undefined ? "#8c959f55" : diverging(um / this.largest_um), 2);
      this.parts.push({ ends: ends.map(place), text: `frame ${name}: ${signedLength(um)} since machine zero` });
    }
    fill(supports, "#8c959f22");
    fill(platform, "#009e7355");
    line([...platform, platform[0]], "#009e73", 2);
    platform.forEach((point) => line([point, tip], "#009e73", 1));
    const corrected = (actuator) => diverging(this.corrections_um[actuator] / this.largest_um);
    const said = (actuator) => `${mechanism.actuators[actuator].kind === "extends" ? "link" : "actuator"} ${actuator + 1}: correction ${signedLength(this.corrections_um[actuator])}`;
    for (const { actuator, points, dash } of actuators) {
      if (dash) {
        line(points, faint, 1, dash);
        continue;
      }
      if (this.page.selected === actuator + 1) line(points, ink("--ink"), 9);
      line(points, corrected(actuator), 5);
      this.parts.push({ ends: points.map(place), text: said(actuator) });
    }
    const numbered = new Set();
    mechanism.rods.forEach((rod, k) => {
      const ends = [base[k], platform[k]];
      const actuator = rod.actuator - 1;
      const extending = mechanism.actuators[actuator].kind === "extends";
      if (extending && this.page.selected === actuator + 1) line(ends, ink("--ink"), 9);
      line(ends, extending ? corrected(actuator) : ink("--soft"), extending ? 5 : 3);
      const length = `${Math.hypot(...base[k].map((value, axis) => value - platform[k][axis])).toFixed(3)} mm long`;
      this.parts.push({ ends: ends.map(place), text: extending ? `${said(actuator)}, ${length}` : `rod ${k + 1} on ${said(actuator)}, ${length}` });
      if (numbered.has(actuator)) return;
      numbered.add(actuator);
      const [x, y] = place(base[k]);
      context.fillStyle = ink("--ink");
      context.font = "bold 12px system-ui";
      context.fillText(String(actuator + 1), x + 8, y - 6);
    });
    for (const { points, rod } of hingeParts(this.machine, this.scene)) {
      line(points, "#8a2d7c", 5);
      this.parts.push({ ends: points.map(place), text: `hinge of rod ${rod}` });
    }
    line(this.trail.map(([, point]) => point), ink("--line"), 1.5);
    const [x, y] = place(tip);
    context.beginPath();
    context.arc(x, y, 4, 0, 7);
    context.fillStyle = ink("--ink");
    context.fill();
    this.drawColours();
  }

  drawColours() {
    const { context, width, height } = prepared(this.colours);
    for (let x = 0; x < width; x++) {
      context.fillStyle = diverging((2 * x) / width - 1);
      context.fillRect(x, 0, 1, height - 14);
    }
    context.fillStyle = ink("--soft");
    context.font = "11px system-ui";
    context.fillText(`−${this.largest_um.toFixed(1)}`, 0, height - 2);
    context.textAlign = "center";
    context.fillText("0 µm", width / 2, height - 2);
    context.textAlign = "right";
    context.fillText(`+${this.largest_um.toFixed(1)}`, width, height - 2);
    context.textAlign = "left";
  }

  // The numbers of the part that is pointed at.
  hover(x, y) {
    const distance = ({ ends: [[ax, ay], [bx, by]] }) => {
      const along = Math.max(0, Math.min(1, ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / ((bx - ax) ** 2 + (by - ay) ** 2 || 1)));
      return Math.hypot(x - ax - along * (bx - ax), y - ay - along * (by - ay));
    };
    const nearest = this.parts.map((part) => ({ part, away: distance(part) })).sort((a, b) => a.away - b.away)[0];
    document.getElementById("part").textContent = nearest && nearest.away < 12 ? nearest.part.text : "Point at a part of the machine.";
  }
}
