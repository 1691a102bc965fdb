// What moves the rods of a machine, and its hinges: lines in {M}, from MACHINE's mechanism and an event's scene.
const HINGE_SHARE = 0.06;
const RAIL_SHARE = 0.35;
const CIRCLE_PARTS = 48;
const DASH = [4, 4];

// A vector turned by a rotation vector, rad.
export function turned(vector, rotation) {
  const angle = Math.hypot(...rotation);
  if (!angle) return vector;
  const axis = rotation.map((value) => value / angle);
  const along = axis.reduce((sum, value, k) => sum + value * vector[k], 0);
  const across = [0, 1, 2].map((k) => axis[(k + 1) % 3] * vector[(k + 2) % 3] - axis[(k + 2) % 3] * vector[(k + 1) % 3]);
  return vector.map((value, k) => value * Math.cos(angle) + across[k] * Math.sin(angle) + axis[k] * along * (1 - Math.cos(angle)));
}

const away = (point, direction, by) => point.map((value, k) => value + direction[k] * by);

// Largest extent of the joints along an axis, mm.
function sizeOf({ base, platform }) {
  const joints = [...base, ...platform];
  return Math.max(...[0, 1, 2].map((k) => Math.max(...joints.map((point) => point[k])) - Math.min(...joints.map((point) => point[k]))));
}

// Rails and cranks with their circles; a leg that extends is its own rod and has none. The rods of one carriage or
// crank are joined by a line.
export function actuatorParts({ geometry, mechanism }, scene) {
  const { rotation_B0_in_M_rad: rotation, origin_B0_in_M_mm: origin } = geometry.base;
  const inM = (vector) => turned(vector, rotation);
  const half = RAIL_SHARE * sizeOf(scene);
  const parts = [];
  mechanism.actuators.forEach((actuator, number) => {
    if (actuator.kind === "extends") return;
    const joints = mechanism.rods.flatMap((rod, k) => (rod.actuator === number + 1 ? [k] : []));
    for (const k of joints) {
      const joint = scene.base[k];
      const foot = away(inM(mechanism.rods[k].base_B_mm), origin, 1);
      if (actuator.kind === "slides") {
        const along = inM(actuator.along_B);
        parts.push({ actuator: number, points: [away(joint, along, -half), away(joint, along, half)], dash: DASH });
        parts.push({ actuator: number, points: [away(joint, along, -half / 8), away(joint, along, half / 8)] });
      } else {
        const [cosine, sine] = [inM(actuator.cosine_B), inM(actuator.sine_B)];
        const circle = Array.from({ length: CIRCLE_PARTS + 1 }, (_, part) => {
          const angle = (2 * Math.PI * part) / CIRCLE_PARTS;
          return away(away(foot, cosine, actuator.radius_mm * Math.cos(angle)), sine, actuator.radius_mm * Math.sin(angle));
        });
        parts.push({ actuator: number, points: circle, dash: DASH });
        parts.push({ actuator: number, points: [foot, joint] });
      }
    }
    for (let k = 1; k < joints.length; k++) parts.push({ actuator: number, points: [scene.base[joints[k - 1]], scene.base[joints[k]]] });
  });
  return parts;
}

// A short line along the axis of each hinge, at its joint.
export function hingeParts({ geometry, mechanism }, scene) {
  const half = HINGE_SHARE * sizeOf(scene);
  return mechanism.hinges.map(({ rod, axis_P, axis_B }) => {
    const axis = axis_P ? turned(axis_P, scene.rotation) : turned(axis_B, geometry.base.rotation_B0_in_M_rad);
    const joint = (axis_P ? scene.platform : scene.base)[rod - 1];
    return { rod, points: [away(joint, axis, -half), away(joint, axis, half)] };
  });
}
