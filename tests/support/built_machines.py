"""Machines built otherwise than drawn, and recordings of their poses; by `compd.simulation`, which shares no code with
the model."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml
from scipy.spatial.transform import Rotation

import compd
from compd.arrays import FloatArray
from compd.calibration import Calibration, Parameters, calibration_parameters
from compd.comparison import AlignedRecording
from compd.configuration import load
from compd.machine_kinds import KINDS, machine_text
from compd.simulation import Mechanism

TOLERANCE_MM = 0.05
NOISE_MM, NOISE_RAD = 0.005, 20e-6
# How far poses go from machine zero along what a target fixes: mm, rad.
REACH_MM, REACH_RAD = 70.0, 0.2


class World(NamedTuple):
    """A machine as drawn and as built.

    gain, zero_mm : (m,) of the scales: an actuator stands at reading (1 + gain) + zero beyond the drawing's zero.
    bend : (m,) per mm, what reading^2 adds.
    moved_mm : (m,) from there to the place at which the built machine has its tip at machine zero.
    """

    drawn: Mechanism
    built: Mechanism
    gain: FloatArray
    zero_mm: FloatArray
    moved_mm: FloatArray
    bend: FloatArray
    name: str


def drawing(kind: str, directory: Path, tolerance_mm: float = TOLERANCE_MM) -> Path:
    """The machine's configuration as a file."""
    path = directory / f"{kind}.yaml"
    path.write_text(machine_text(kind, kind, KINDS[kind].usual, f"{tolerance_mm:g}"), encoding="utf-8")
    return path


# Kinds of numbers of a machine, as the blocks of a calibration have them.
OFF = ("base", "platform", "length", "way", "radius", "hinge", "zero", "gain")


def built(path: Path, rng: np.random.Generator, tolerance_mm: float = TOLERANCE_MM, probability: float = 1.0) -> World:
    """The machine with every number off by its tolerance: normal, with the tolerance as standard deviation.

    probability : that the numbers of a kind are off at all; those of the other kinds are as drawn.
    """
    sizes = {kind: tolerance_mm * (probability >= 1.0 or rng.random() < probability) for kind in OFF}
    text = path.read_text(encoding="utf-8").replace("{on: platform", '{"on": platform')
    data: dict[str, Any] = yaml.safe_load(text)
    geometry = data["geometry"]
    off = copy.deepcopy(geometry)
    joints = np.array([rod["platform_P_mm"] for rod in geometry["rods"]], dtype=np.float64)
    radius_mm = float(np.sqrt(((joints - joints.mean(axis=0)) ** 2).sum(axis=1).mean()))
    for rod in off["rods"]:
        for end, kind in (("base_B_mm", "base"), ("platform_P_mm", "platform")):
            rod[end] = (np.array(rod[end]) + sizes[kind] * rng.standard_normal(3)).tolist()
        if "length_mm" in rod:
            rod["length_mm"] += float(sizes["length"] * rng.standard_normal())
    for actuator in off["actuators"]:
        off_rad = sizes["way"] / radius_mm * rng.standard_normal(3)
        if "cosine_B" in actuator:
            # a turn about its own axis is another zero, which is a number of its own
            axis = np.cross(actuator["cosine_B"], actuator["sine_B"])
            off_rad -= axis * (axis @ off_rad) / (axis @ axis)
        turn = Rotation.from_rotvec(off_rad).as_matrix()
        for key in ("along_B", "cosine_B", "sine_B"):
            if key in actuator:
                actuator[key] = (turn @ np.array(actuator[key])).tolist()
        if "radius_mm" in actuator:
            actuator["radius_mm"] += float(sizes["radius"] * rng.standard_normal())
    for hinge in off.get("hinges", []):
        for key in ("axis_P", "axis_B"):
            if key in hinge:
                axis = np.array(hinge[key]) + sizes["hinge"] / radius_mm * rng.standard_normal(3)
                hinge[key] = (axis / np.linalg.norm(axis)).tolist()
    other = path.with_name(f"built-{path.name}")
    other.write_text(yaml.safe_dump({**data, "geometry": off}, sort_keys=False), encoding="utf-8")
    drawn, real = (Mechanism(load(one).geometry) for one in (path, other))
    # where the actuators stand at machine zero is a number of its own, whatever the tip does there
    zero_mm = sizes["zero"] * rng.standard_normal(drawn.scales)
    moved_mm = np.where(
        drawn.extended[drawn.link_of_scale],
        _first(drawn, drawn.lengths0_mm) - _first(real, real.lengths0_mm),
        _zeros(drawn) - _zeros(real),
    )
    gain = sizes["gain"] / (2 * REACH_MM) * rng.standard_normal(drawn.scales)
    return World(drawn, real, gain, zero_mm, moved_mm, np.zeros(drawn.scales), path.stem)


def _first(mechanism: Mechanism, of_link: FloatArray) -> FloatArray:
    """(m,) of the first link of each actuator."""
    return of_link[mechanism.link_of_scale]


def _zeros(mechanism: Mechanism) -> FloatArray:
    """(m,) where the actuators stand with the tip at machine zero."""
    return mechanism._zero_mm


def targets(world: World, rng: np.random.Generator) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Places (3,) mm and turns (3,) rad from machine zero, all over the workspace, along what a target fixes."""
    fixed = world.drawn.fixed
    while True:
        yield rng.uniform(-1, 1, 3) * REACH_MM * fixed[:3], rng.uniform(-1, 1, 3) * REACH_RAD * fixed[3:]


def poses(
    world: World, wanted: Iterable[tuple[FloatArray, FloatArray]]
) -> Iterator[tuple[FloatArray, FloatArray, FloatArray]]:
    """Readings (m,), tip (3,) in {M} and attitude (3, 3) of {P} in {M} at targets that the machine reaches."""
    drawn, real = world.drawn, world.built
    for place, turn in wanted:
        try:
            posture = drawn.posture_at(drawn.tip0_M + place, turn)
            reading = drawn.scales_at(posture)
            standing = reading * (1 + world.gain) + world.bend * reading**2 + world.zero_mm + world.moved_mm
            posture = real.posture_of(standing, posture)
        except compd.CompdError:
            continue
        yield reading, np.append(1.0, drawn.tip0_P) @ posture, posture[1:].T


def record(
    path: Path,
    world: World,
    rng: np.random.Generator,
    count: int,
    wanted: Iterable[tuple[FloatArray, FloatArray]] | None = None,
    noise: float = 1.0,
    pose: bool = True,
    gross_mm: Mapping[int, float | FloatArray] | None = None,
    gross_scale: Mapping[int, tuple[int, float]] | None = None,
    reflectors: dict[str, list[float]] | None = None,
) -> Path:
    """A recording in an instrument's frame, with a target of its own place and turn where it shows attitudes.

    noise : times `NOISE_MM` and `NOISE_RAD`.  pose : False for positions of the tip alone.  gross_mm : error of single
    poses, by their place, along x or in space.  gross_scale : of single poses a scale and its error, mm.
    reflectors : places on the platform, each seen at every pose in place of the tip.
    """
    frame, body = Rotation.from_rotvec(rng.uniform(-1, 1, 3)), Rotation.from_rotvec(rng.uniform(-1, 1, 3))
    at, place_P = rng.uniform(-500, 500, 3), rng.uniform(-30, 30, 3) if pose else np.zeros(3)
    lines: list[str] = []
    for reading, tip, R in poses(world, targets(world, rng) if wanted is None else wanted):
        for name, on_P in (reflectors or {"": place_P.tolist()}).items():
            seen = frame.apply(tip + R @ np.array(on_P)) + at + noise * NOISE_MM * rng.standard_normal(3)
            off_mm = (gross_mm or {}).get(len(lines), 0.0)
            seen = seen + (np.array([off_mm, 0.0, 0.0]) if isinstance(off_mm, float) else off_mm)
            row = [*reading, *seen]
            if len(lines) in (gross_scale or {}):
                scale, error_mm = (gross_scale or {})[len(lines)]
                row[scale] += error_mm
            if pose:
                off = Rotation.from_rotvec(noise * NOISE_RAD * rng.standard_normal(3))
                row += (off * frame * Rotation.from_matrix(R) * body).as_quat().tolist()
            lines.append(",".join([*(repr(float(value)) for value in row), *([name] if name else [])]))
        if len(lines) >= count:
            break
    names = [f"scale_{i + 1}_mm" for i in range(world.drawn.scales)] + [f"reference_{axis}_mm" for axis in "xyz"]
    names += [f"reference_q{part}" for part in "xyzw"] if pose else []
    names += ["reflector"] if reflectors else []
    path.write_text("\n".join([",".join(names), *lines]) + "\n", encoding="utf-8")
    reference: dict[str, Any] = {"quantity": "tool_pose" if pose else "tool_position", "frame": "instrument"}
    reference["sigma_um"] = 1e3 * NOISE_MM
    reference |= {"sigma_urad": 1e6 * NOISE_RAD} if pose else {}
    reference |= {"reflectors": reflectors} if reflectors else {}
    sidecar = {"machine": world.name, "machine_file": f"{world.name}.yaml", "reference": reference}
    path.with_suffix(".yaml").write_text(yaml.safe_dump(sidecar), encoding="utf-8")
    return path


def truth(world: World, parameters: Parameters) -> FloatArray:
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
    own["scale_gain_change"] = 1e6 * world.bend
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


def deviations(world: World, learned: AlignedRecording, result: Calibration) -> FloatArray:
    """Of the claimed numbers from the truth, in standard errors."""
    without = ["tool_offset"] if learned.target is not None else []
    assert learned.model is not None
    parameters = calibration_parameters(learned.model, learned.rows, (), without)
    off = truth(world, parameters)
    return np.array(
        [(n.change - own) / n.std for n, own in zip(result.numbers, off, strict=True) if n.claimed], dtype=np.float64
    )
