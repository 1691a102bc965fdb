"""`python -m tests.calibration_truth`: calibrations of simulated machines whose every number is off by its tolerance.

The machines are those of `compd.machine_kinds`. Truth is `compd.simulation`, which shares no code with the model: the
numbers of a machine's YAML are changed, and readings and poses computed from them. Told are, pooled over machines:
which share of 95 % intervals holds the truth; the error at poses of the whole workspace, over that of a fit with the
truth's own blocks; and the same of `scipy.optimize.least_squares` over all numbers, without and with the tolerance as
prior.
"""

from __future__ import annotations

import argparse
import copy
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

import compd
from compd.arrays import FloatArray, rms
from compd.calibration import calibrate
from compd.calibration.machine_fit import fit_machine, registered_mm
from compd.calibration.parameters import Parameters, calibration_parameters
from compd.calibration.poses import MeasuredPoses
from compd.configuration import load
from compd.machine_kinds import KINDS, machine_text
from compd.simulation import Mechanism

TOLERANCE_MM = 0.05
NOISE_MM, NOISE_RAD = 0.005, 20e-6
# How far poses go from machine zero along what a target fixes: mm, rad.
REACH_MM, REACH_RAD = 70.0, 0.2
WITHIN_STD = 1.96


class World(NamedTuple):
    """A machine as drawn and as built.

    gain, zero_mm : (m,) of the scales: an actuator stands at reading (1 + gain) + zero beyond the drawing's zero.
    moved_mm : (m,) from there to the place at which the built machine has its tip at machine zero.
    """

    drawn: Mechanism
    built: Mechanism
    gain: FloatArray
    zero_mm: FloatArray
    moved_mm: FloatArray


def drawing(kind: str, directory: Path) -> Path:
    """The machine's configuration as a file."""
    path = directory / f"{kind}.yaml"
    path.write_text(machine_text(kind, kind, KINDS[kind].usual), encoding="utf-8")
    return path


def built(path: Path, rng: np.random.Generator) -> World:
    """The machine with every number off by its tolerance: normal, with the tolerance as standard deviation."""
    text = path.read_text(encoding="utf-8").replace("{on: platform", '{"on": platform')
    data: dict[str, Any] = yaml.safe_load(text)
    geometry = data["geometry"]
    off = copy.deepcopy(geometry)
    joints = np.array([rod["platform_P_mm"] for rod in geometry["rods"]], dtype=np.float64)
    radius_mm = float(np.sqrt(((joints - joints.mean(axis=0)) ** 2).sum(axis=1).mean()))
    tilt = TOLERANCE_MM / radius_mm
    for rod in off["rods"]:
        for end in ("base_B_mm", "platform_P_mm"):
            rod[end] = (np.array(rod[end]) + TOLERANCE_MM * rng.standard_normal(3)).tolist()
        if "length_mm" in rod:
            rod["length_mm"] += float(TOLERANCE_MM * rng.standard_normal())
    for actuator in off["actuators"]:
        turn = Rotation.from_rotvec(tilt * rng.standard_normal(3)).as_matrix()
        for key in ("along_B", "cosine_B", "sine_B"):
            if key in actuator:
                actuator[key] = (turn @ np.array(actuator[key])).tolist()
        if "radius_mm" in actuator:
            actuator["radius_mm"] += float(TOLERANCE_MM * rng.standard_normal())
    for hinge in off.get("hinges", []):
        for key in ("axis_P", "axis_B"):
            if key in hinge:
                axis = np.array(hinge[key]) + tilt * rng.standard_normal(3)
                hinge[key] = (axis / np.linalg.norm(axis)).tolist()
    other = path.with_name(f"built-{path.name}")
    other.write_text(yaml.safe_dump({**data, "geometry": off}, sort_keys=False), encoding="utf-8")
    drawn, real = (Mechanism(load(one).geometry) for one in (path, other))
    # where the actuators stand at machine zero is a number of its own, whatever the tip does there
    zero_mm = TOLERANCE_MM * rng.standard_normal(drawn.scales)
    moved_mm = np.where(
        drawn.extended[drawn.link_of_scale],
        _first(drawn, drawn.lengths0_mm) - _first(real, real.lengths0_mm),
        _zeros(drawn) - _zeros(real),
    )
    gain = TOLERANCE_MM / (2 * REACH_MM) * rng.standard_normal(drawn.scales)
    return World(drawn, real, gain, zero_mm, moved_mm)


def _first(mechanism: Mechanism, of_link: FloatArray) -> FloatArray:
    """(m,) of the first link of each actuator."""
    return of_link[mechanism.link_of_scale]


def _zeros(mechanism: Mechanism) -> FloatArray:
    """(m,) where the actuators stand with the tip at machine zero."""
    return mechanism._zero_mm


def poses(world: World, rng: np.random.Generator, count: int) -> Iterator[tuple[FloatArray, FloatArray, FloatArray]]:
    """Readings (m,), tip (3,) in {M}, attitude (3, 3) of {P} in {M} of random targets."""
    drawn, real = world.drawn, world.built
    made = 0
    while made < count:
        tip = drawn.tip0_M + rng.uniform(-1, 1, 3) * REACH_MM * drawn.fixed[:3]
        turn = rng.uniform(-1, 1, 3) * REACH_RAD * drawn.fixed[3:]
        try:
            wanted = drawn.posture_at(tip, turn)
            reading = drawn.scales_at(wanted)
            posture = real.posture_of(reading * (1 + world.gain) + world.zero_mm + world.moved_mm, wanted)
        except compd.CompdError:
            continue
        made += 1
        yield reading, np.append(1.0, drawn.tip0_P) @ posture, posture[1:].T


def record(
    path: Path, world: World, rng: np.random.Generator, count: int, noisy: bool, machine: str, pose: bool
) -> Path:
    """A recording in an instrument's frame, with a target of its own place and turn where it shows attitudes."""
    frame, body = Rotation.from_rotvec(rng.uniform(-1, 1, 3)), Rotation.from_rotvec(rng.uniform(-1, 1, 3))
    at, place_P = rng.uniform(-500, 500, 3), rng.uniform(-30, 30, 3) if pose else np.zeros(3)
    lines = []
    for reading, tip, R in poses(world, rng, count):
        seen = frame.apply(tip + R @ place_P) + at + noisy * NOISE_MM * rng.standard_normal(3)
        row = [*reading, *seen]
        if pose:
            noise = Rotation.from_rotvec(noisy * NOISE_RAD * rng.standard_normal(3))
            row += (noise * frame * Rotation.from_matrix(R) * body).as_quat().tolist()
        lines.append(",".join(repr(float(value)) for value in row))
    names = [f"scale_{i + 1}_mm" for i in range(world.drawn.scales)] + [f"reference_{axis}_mm" for axis in "xyz"]
    names += [f"reference_q{part}" for part in "xyzw"] if pose else []
    path.write_text("\n".join([",".join(names), *lines]) + "\n", encoding="utf-8")
    reference = {
        "quantity": "tool_pose" if pose else "tool_position",
        "frame": "instrument",
        "sigma_um": 1e3 * NOISE_MM,
    }
    reference |= {"sigma_urad": 1e6 * NOISE_RAD} if pose else {}
    path.with_suffix(".yaml").write_text(yaml.safe_dump({"machine": machine, "reference": reference}), encoding="utf-8")
    return path


def truth(world: World, parameters: Parameters, model: Any) -> FloatArray:
    """(P,) by how much each number is off, in the units of the parameters."""
    drawn, real = world.drawn, world.built
    own = {}
    extended = drawn.extended
    own["link_zero"] = np.where(
        extended,
        world.zero_mm[drawn.scale_of_link],
        real._rods_mm - drawn._rods_mm,
    )
    own["actuator_zero"] = world.zero_mm
    own["scale_gain"] = 1e6 * world.gain
    own["scale_gain_change"] = np.zeros(drawn.scales)
    own["base_joint_position"] = (real.still_joints_M - drawn.still_joints_M).ravel()
    own["platform_joint_position"] = (real.joints_P - drawn.joints_P).ravel()
    own["tool_offset"] = np.zeros(3)
    ways = list(zip(drawn._ways, real._ways, strict=True))
    u = np.array([a._cosine_B for a, _ in ways])
    v = np.array([a._sine_B for a, _ in ways])
    du = np.array([b._cosine_B - a._cosine_B for a, b in ways])
    dv = np.array([b._sine_B - a._sine_B for a, b in ways])
    radius = np.array([a._radius_mm for a, _ in ways])
    own["crank_radius"] = np.array([b._radius_mm - a._radius_mm for a, b in ways])
    if (radius > 0).any():
        n = np.cross(u, v)
        own["actuator_direction"] = 1e6 * np.concatenate([(dv * n).sum(1), -(du * n).sum(1)])
        # a circle that is turned in its plane has another zero
        own["actuator_zero"] = own["actuator_zero"] + radius * (du * v).sum(1)
    else:
        # rails along z: square to them are x, and z x x = y
        own["actuator_direction"] = 1e6 * np.concatenate([du[:, 0], du[:, 1]])
    e, de = drawn.axes_P, real.axes_P - drawn.axes_P
    if len(e):
        own["revolute_axis_tilt"] = 1e6 * (de * np.cross([0.0, 0.0, 1.0], e)).sum(1)
        own["hinge_inclination"] = 1e6 * de[:, 2]
    values = [own[block.effect.id][block.used[: len(own[block.effect.id])]] for block in parameters.blocks]
    return np.concatenate(values)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--machines", type=int, default=3)
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--scipy", action="store_true")
    parser.add_argument("--poses", type=int, default=0)
    parser.add_argument("--position", action="store_true")
    arguments = parser.parse_args()
    inside_all: list[bool] = []
    for kind in arguments.kinds.split(","):
        inside: list[bool] = []
        inside_needed: list[bool] = []
        ratios, drawn_ratio, plain, with_prior, lengths = [], [], [], [], []
        for seed in range(arguments.machines):
            with tempfile.TemporaryDirectory() as place:
                directory = Path(place)
                rng = np.random.default_rng([seed, list(KINDS).index(kind)])
                path = drawing(kind, directory)
                world = built(path, rng)
                count = arguments.poses or int(rng.integers(30, 101))
                pose = not arguments.position
                learned = compd.open_recording(record(directory / "a.csv", world, rng, count, True, kind, pose), path)
                other = compd.open_recording(record(directory / "b.csv", world, rng, 100, False, kind, pose), path)
                result = calibrate([learned], [other])
                parameters = calibration_parameters(learned.model, learned.rows, (), ["tool_offset"] if pose else [])
                own = truth(world, parameters, learned.model)
                for number, off in zip(result.numbers, own, strict=True):
                    if number.claimed:
                        inside.append(abs(number.change - off) <= WITHIN_STD * number.std)
                    if number.needed:
                        inside_needed.append(abs(number.change - off) <= WITHIN_STD * number.std)
                mine = result.sealed[0]
                structure = _structure_um(learned, other, parameters)
                ratios.append(mine.after_rms_um / structure)
                drawn_ratio.append(mine.before_rms_um)
                lengths.append(mine.after_rms_um)
                if arguments.scipy:
                    plain.append(_scipy_um(learned, other, parameters, 0.0) / structure)
                    with_prior.append(_scipy_um(learned, other, parameters, 1.0) / structure)
        inside_all += inside
        print(
            f"{kind:13} 95 % hold {100 * np.mean(inside):5.1f} % of {len(inside)} claimed, "
            f"{100 * np.mean(inside_needed):5.1f} % of {len(inside_needed)} needed; drawn "
            f"{np.median(drawn_ratio):6.1f} um, calibrated {np.median(lengths):5.2f} um, over the truth's structure "
            f"{np.median(ratios):.2f} (largest {np.max(ratios):.2f})"
            + (f"; scipy {np.median(plain):.2f}, with prior {np.median(with_prior):.2f}" if plain else ""),
            flush=True,
        )
    print(f"pooled: {100 * np.mean(inside_all):.1f} % of {len(inside_all)}")


def _structure_um(learned: Any, other: Any, parameters: Parameters) -> float:
    """A fit of all blocks that the truth has, with its tolerances as prior."""
    free = ~np.array([name.startswith(("scale_gain_change", "tool_offset")) for name in parameters.names])
    fit = fit_machine([MeasuredPoses.of(learned, parameters)], parameters, free)
    return _error_um(other, parameters, fit.theta)


def _error_um(other: Any, parameters: Parameters, theta: FloatArray) -> float:
    count = len(theta)
    effects = parameters.split(theta, np.zeros((count, count)), range(len(parameters.blocks)))
    now = MeasuredPoses.of(other, parameters).now(effects)
    left = registered_mm(now, now.use)[1][now.use][:, now.aligned.lengths]
    return 1e3 * rms(left)


def _scipy_um(learned: Any, other: Any, parameters: Parameters, prior: float) -> float:
    """`scipy.optimize.least_squares` over all numbers of the truth, in tolerances."""
    poses = MeasuredPoses.of(learned, parameters)
    free = ~np.array([name.startswith(("scale_gain_change", "tool_offset")) for name in parameters.names])
    count = len(free)
    sigma = np.full(learned.measured_mm.shape[1], NOISE_MM)
    if learned.with_attitude:
        sigma[3:] = 1e3 * NOISE_RAD

    def residual(x: FloatArray) -> FloatArray:
        theta = np.zeros(count)
        theta[free] = x * parameters.prior_std[free]
        now = poses.now(parameters.split(theta, np.zeros((count, count)), range(len(parameters.blocks))))
        R = (now.registration_mm[poses.use] / sigma[:, None]).reshape(-1, now.registration_mm.shape[2])
        y = (now.residual_mm[poses.use] / sigma).ravel()
        y = y - R @ np.linalg.lstsq(R, y, rcond=None)[0]
        return np.concatenate([y, prior * x])

    found = least_squares(residual, np.zeros(int(free.sum())), x_scale="jac" if not prior else 1.0, max_nfev=30)
    theta = np.zeros(count)
    theta[free] = found.x * parameters.prior_std[free]
    return _error_um(other, parameters, theta)


if __name__ == "__main__":
    main()
