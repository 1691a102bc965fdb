// Numbers with sign and a fixed number of decimals, so that the text does not jump.
export function signed(value, digits = 1) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const text = Math.abs(value).toFixed(digits);
  return (value < 0 && Number(text) !== 0 ? "−" : "+") + text;
}

// A length with three digits and its unit: in µm below a millimetre, in mm from there on; never in powers of ten.
export function lengthText(um) {
  if (!Number.isFinite(um)) return "–";
  const in_mm = Math.abs(Number(um.toPrecision(3))) >= 1000;
  const value = Number((in_mm ? um / 1000 : um).toPrecision(3));
  return `${value < 0 ? "−" : ""}${Math.abs(value)} ${in_mm ? "mm" : "µm"}`;
}

// A length with its sign: one decimal in µm below a millimetre, three digits in mm from there on.
export function signedLength(um) {
  if (!(Math.abs(um) >= 999.95)) return `${signed(um)} µm`;
  return `${um < 0 ? "" : "+"}${lengthText(um)}`;
}

// Amounts of one quantity, one after the other, each with two decimals: "1.01 → 1.15 µm"; a length as `lengthText` has
// it where one of them is a millimetre or more.
export function amounts(values, unit) {
  if (unit === "um" && values.some((value) => Math.abs(value) >= 999.5)) return values.map(lengthText).join(" → ");
  return `${values.map((value) => value?.toFixed(2) ?? "–").join(" → ")} ${micro(unit)}`;
}

// The tip in {M}, and the bound of its error; blanks as wide as a figure keep y and z where they are, as far as a
// metre.
export function tipText(tip_M_mm, u_tip_um) {
  const axes = ["x", "y", "z"].map((axis, k) => `${axis} ${signed(tip_M_mm[k], 4)}`.padStart(k ? 11 : 0, "\u2007"));
  return `${axes.join("  ")} mm${isKnown(u_tip_um) ? `, within ${lengthText(u_tip_um)}` : ""}`;
}

// Whether the bound of the tip's error is known: it is null if unknown, and absent in an invalid setpoint.
export function isKnown(u_tip_um) {
  return Number.isFinite(u_tip_um);
}

// Date and time by ISO 8601 in this computer's zone, unambiguous in every country.
export function dateText(date) {
  const two = (number) => String(number).padStart(2, "0");
  return `${date.getFullYear()}-${two(date.getMonth() + 1)}-${two(date.getDate())} ${date.toTimeString().slice(0, 8)}`;
}

export function ago(seconds) {
  if (seconds < 0.9995) return `${Math.round(seconds * 1000)} ms`;
  if (seconds < 60) return `${seconds.toFixed(1)} s`;
  const whole = Math.round(seconds);
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")} min`;
}

export function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key === "class") made.className = value;
    else if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
    else if (value !== false && value !== undefined) made.setAttribute(key, value === true ? "" : value);
  }
  made.append(...children);
  return made;
}

// The same colour for the same cause everywhere: joints, frame, then the effects in their order.
export function causeColour(index) {
  return `var(--cause-${index % 7})`;
}

// A canvas with as many pixels as the screen has, and its context in CSS pixels.
export function prepared(canvas) {
  const { width, height } = canvas.getBoundingClientRect();
  const ratio = window.devicePixelRatio || 1;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return { context, width, height };
}

export function ink(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

// Units are written without Greek letters in files and messages.
export function micro(unit) {
  return unit.replace(/^u(?=m|rad|in)/, "µ").replace("/um", "/µm").replace("degC", "°C");
}
