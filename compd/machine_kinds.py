"""Machines of eight kinds from a few dimensions, as the text of a configuration.

Every kind is the same few arrays: where the base joints are, where the platform joints are, what moves them, which
hinges there are, and what a target fixes. The machine is symmetric; a real one is measured, and its numbers put in.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.errors import CompdError, Problem

# Azimuths in degrees of the three legs, or of the middles of the three pairs of legs.
_THREE = (90.0, 210.0, 330.0)
_DECIMALS = 6
MAX_MM = 20_000.0


class Dimensions(NamedTuple):
    """What a machine of a kind is made from, in mm and degrees; all others follow.

    base_radius_mm, platform_radius_mm : circles on which the joints are.
    base_angle_deg, platform_angle_deg : between the two joints of a pair, of machines with six legs.
    height_mm : of the platform joints above the base joints at machine zero; negative where the platform hangs.
    spacing_mm : between the two rods of a delta's arm.  crank_mm : radius of a turning actuator.
    tool_mm : of the tip beyond the platform joints, away from the base.
    """

    base_radius_mm: float
    platform_radius_mm: float
    height_mm: float
    base_angle_deg: float = 20.0
    platform_angle_deg: float = 20.0
    spacing_mm: float = 60.0
    crank_mm: float = 80.0
    tool_mm: float = 30.0


class MachineKind(NamedTuple):
    """One kind of machine.

    meaning : for help.  usual : dimensions to begin with.  actuator : "extends", "slides" or "turns".
    legs : "six", "three" or "pairs" of parallel rods on one actuator each.
    hinge : which end of a rod carries a revolute joint, "P", "B" or "" for none.  target_fixes : as in `geometry:`.
    """

    meaning: str
    usual: Dimensions
    actuator: str
    legs: str
    hinge: str
    target_fixes: str


KINDS: Mapping[str, MachineKind] = {
    "6-ups": MachineKind(
        "hexapod or Stewart platform: six legs that extend", Dimensions(250, 120, 450), "extends", "six", "", "xyzabc"
    ),
    "6-pus": MachineKind(
        "hexaglide: six rods, their base joints on rails", Dimensions(250, 120, 450), "slides", "six", "", "xyzabc"
    ),
    "6-rus": MachineKind("hexapod with six cranks and rods", Dimensions(250, 120, 400), "turns", "six", "", "xyzabc"),
    "3-spr": MachineKind(
        "tripod: three extending legs, hinged at the platform", Dimensions(250, 80, 480), "extends", "three", "P", "xyz"
    ),
    "3-rps": MachineKind(
        "tripod: three extending legs, hinged at the base", Dimensions(250, 80, 480), "extends", "three", "B", "zab"
    ),
    "3-prs": MachineKind(
        "tripod: three rods on rails, hinged at the carriages", Dimensions(250, 80, 480), "slides", "three", "B", "zab"
    ),
    "linear-delta": MachineKind(
        "delta: three carriages on rails, two rods each", Dimensions(190, 35, -300), "slides", "pairs", "", "xyz"
    ),
    "rotary-delta": MachineKind(
        "delta: three cranks, two rods each", Dimensions(100, 40, -290), "turns", "pairs", "", "xyz"
    ),
}


class _Rod(NamedTuple):
    """A rod at machine zero: its joints in {B} and {P}, both with axes along {M}; arm_B : where a crank points."""

    actuator: int
    base_B: FloatArray
    platform_P: FloatArray
    arm_B: FloatArray
    axis: FloatArray


def dimension_problems(kind: MachineKind, dimensions: Dimensions) -> list[Problem]:
    """Every dimension of which no machine can be made."""
    problems = []
    for name, value in dimensions._asdict().items():
        angle = name.endswith("_deg")
        low, high = (0.0, 120.0) if angle else (-MAX_MM if name in ("height_mm", "tool_mm") else 0.0, MAX_MM)
        if not math.isfinite(value) or not low <= value <= high:
            problems.append(_problem(name, value, f"{low:g} to {high:g} {'deg' if angle else 'mm'}"))
    above_0 = ("base_radius_mm", "platform_radius_mm", *(["crank_mm"] if kind.actuator == "turns" else []))
    problems += [_problem(name, 0.0, "more than 0 mm") for name in above_0 if getattr(dimensions, name) == 0]
    if dimensions.height_mm == 0:
        problems.append(_problem("height_mm", 0.0, "above or below the base: not 0 mm"))
    if kind.legs == "pairs" and dimensions.spacing_mm == 0:
        problems.append(_problem("spacing_mm", 0.0, "more than 0 mm: two rods in one place hold no attitude"))
    return problems


def machine_text(name: str, kind_name: str, dimensions: Dimensions, tolerance: str = "machined") -> str:
    """The configuration of a machine, at most 60 lines; its scales are read over Modbus TCP from one place.

    Raises CompdError, with every problem, for dimensions of which no machine can be made.
    """
    kind = KINDS[kind_name]
    if problems := dimension_problems(kind, dimensions):
        raise CompdError(problems)
    rods = _rods(kind, dimensions)
    scales = max(rod.actuator for rod in rods)
    tip = dimensions.height_mm + math.copysign(dimensions.tool_mm, dimensions.height_mm)
    stated = [*_geometry(kind, dimensions, rods), *_tool(dimensions, tip, tolerance)]
    limits = f"lowest: -{_largest(dimensions)}, highest: {_largest(dimensions)}"
    what = "mm of arc: radius times angle" if kind.actuator == "turns" else "mm"
    lines = [
        f"# A {kind_name}: {kind.meaning}. Made by `compd machine new`; put in the numbers of your drawing.",
        f"machine: {name}",
        "",
        "geometry:                      # {B}, where the base joints are, is {M} here; lengths in mm",
        *(f"  {line}" for line in stated),
        "",
        "lines:",
        "  cabinet: {kind: modbus_tcp, host: 127.0.0.1, port: 502, timeout_s: 0.3, poll_every_s: 0.01}",
        "",
        "gauges:                        # `compd gauge list` has other drivers",
        "  scales:",
        "    driver: modbus",
        "    line: cabinet",
        "    unit: 1",
        "    noise_um: 0.02             # standard deviation of a reading at rest",
        "    acceleration_mm_per_s2: 2000   # the largest of what they measure",
        f"    channels:                  # {what}, counted from anywhere: machine zero is where `compd zero` is done",
        "      # lowest, highest: what the scale can show at most, from its data sheet",
        *(
            f"      - {{name: scale_{i + 1}, function: 4, address: {2 * i}, type: float32, unit: mm, {limits}}}"
            for i in range(scales)
        ),
        "",
        "wiring:                        # thermometers: under `quantities:`; frame comparators: under `frame:`",
        "  scale:",
        *(f"    - {{link: {i + 1}, gauge: scales.scale_{i + 1}}}" for i in range(scales)),
        "",
        "loop: {rate_hz: 50, stale_after_s: 0.5, on_stale: fade, hold_s: 5, priority: 40, lock_memory: true}",
        "limits: {correction_mm: 0.5, slew_mm_per_s: 0.5, on_limit: clamp}",
        "sockets:",
        "  tcp: {host: 127.0.0.1, port: 7751}",
        f"  unix: {{path: /run/compd/{name}.sock}}",
        "  valid_for_s: 0.1",
        f"state: {{directory: /var/lib/compd/{name}}}",
    ]
    return "\n".join(lines) + "\n"


def _largest(dimensions: Dimensions) -> int:
    """A length (mm) that no scale of the machine shows: four times its size, in whole metres."""
    size = max(abs(value) for name, value in dimensions._asdict().items() if name.endswith("_mm"))
    return 1000 * math.ceil(float(4 * size) / 1000)


def _geometry(kind: MachineKind, dimensions: Dimensions, rods: Sequence[_Rod]) -> list[str]:
    """Actuators, rods, hinges, and what a target fixes."""
    firsts = {rod.actuator: rod for rod in reversed(rods)}
    actuators = [_actuator(kind, dimensions, firsts[i]) for i in sorted(firsts)]
    alike = len(set(actuators)) == 1
    lines = ["actuators:"]
    if alike and kind.actuator == "extends":
        lines = [f"actuators: [{', '.join(actuators)}]"]
    else:
        lines += [f"  - {actuator}" for actuator in actuators]
    lines += ["rods:"]
    for rod in rods:
        length = "" if kind.actuator == "extends" else f", length_mm: {_number(_length_mm(kind, dimensions, rod))}"
        ends = f"base_B_mm: {_vector(rod.base_B)}, platform_P_mm: {_vector(rod.platform_P)}"
        lines.append(f"  - {{actuator: {rod.actuator}, {ends}{length}}}")
    if kind.hinge:
        hinges = [f"{{rod: {i}, axis_{kind.hinge}: {_vector(rod.axis)}}}" for i, rod in enumerate(rods, start=1)]
        lines += ["hinges:", *(f"  - {hinge}" for hinge in hinges)]
    return [*lines, f"target_fixes: [{', '.join(kind.target_fixes)}]"]


def _tool(dimensions: Dimensions, tip: float, tolerance: str) -> list[str]:
    beyond = math.copysign(dimensions.tool_mm, dimensions.height_mm)
    return [
        "platform: {weight_N: 20, weight_at_P_mm: [0, 0, 0]}",
        f"tool: {{on: platform, at_P_mm: [0, 0, {_number(beyond)}], zero_tip_M_mm: [0, 0, {_number(tip)}]}}",
        f"tolerance_mm: {tolerance}         # how far the machine as built may be from these numbers",
        "scale_signal_period_mm: 0.02",
    ]


def _rods(kind: MachineKind, d: Dimensions) -> list[_Rod]:
    """The rods at machine zero, where the platform stands level above, or hangs below, the base."""
    if kind.legs == "three":
        return [_rod(i, azimuth, azimuth, d) for i, azimuth in enumerate(_THREE, start=1)]
    if kind.legs == "pairs":
        rods = []
        for i, azimuth in enumerate(_THREE, start=1):
            for side in (0.5, -0.5):
                rod = _rod(i, azimuth, azimuth, d)
                across = -side * d.spacing_mm * rod.axis
                rods.append(rod._replace(base_B=rod.base_B + across, platform_P=rod.platform_P + across))
        return rods
    rods = []
    for pair, azimuth in enumerate(_THREE):
        for side in (-1, 1):
            # a leg leads from its base joint to that platform joint of the next pair which is nearer
            base, platform = azimuth + side * d.base_angle_deg / 2, azimuth + side * (60 - d.platform_angle_deg / 2)
            rod = _rod(2 * pair + (1 if side < 0 else 2), base, platform, d)
            rods.append(rod._replace(arm_B=side * _tangent(base)))
    return rods


def _rod(actuator: int, base_deg: float, platform_deg: float, d: Dimensions) -> _Rod:
    return _Rod(
        actuator,
        d.base_radius_mm * _radial(base_deg),
        d.platform_radius_mm * _radial(platform_deg),
        _radial(base_deg),
        _tangent(base_deg),
    )


def _actuator(kind: MachineKind, d: Dimensions, rod: _Rod) -> str:
    if kind.actuator == "extends":
        return "{kind: extends}"
    if kind.actuator == "slides":
        return "{kind: slides, along_B: [0, 0, 1]}"
    up = math.copysign(1.0, d.height_mm)
    circle = f"cosine_B: {_vector(rod.arm_B)}, sine_B: [0, 0, {_number(up)}]"
    return f"{{kind: turns, radius_mm: {_number(d.crank_mm)}, {circle}}}"


def _length_mm(kind: MachineKind, d: Dimensions, rod: _Rod) -> float:
    """Of a rod at machine zero, where rails stand at 0 and cranks lie level."""
    base = rod.base_B + (d.crank_mm * rod.arm_B if kind.actuator == "turns" else 0.0)
    return float(np.linalg.norm(rod.platform_P + np.array([0.0, 0.0, d.height_mm]) - base))


def _radial(azimuth_deg: float) -> FloatArray:
    azimuth = math.radians(azimuth_deg)
    return np.array([math.cos(azimuth), math.sin(azimuth), 0.0])


def _tangent(azimuth_deg: float) -> FloatArray:
    return _radial(azimuth_deg + 90.0)


def _vector(values: FloatArray) -> str:
    return f"[{', '.join(map(_number, values.tolist()))}]"


def _number(value: float) -> str:
    return f"{round(value, _DECIMALS) + 0.0:g}" if abs(value) < 1 else repr(round(value, _DECIMALS)).removesuffix(".0")


def _problem(name: str, value: float, allowed: str) -> Problem:
    option = "--" + name.removesuffix("_mm").removesuffix("_deg").replace("_", "-")
    return Problem(option, "gives no machine", value=f"{value:g}", allowed=allowed)
