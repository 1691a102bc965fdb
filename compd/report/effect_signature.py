"""An effect's signature on a machine: its displacement of the tip over the workspace, and against its drivers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.errors import CompdError
from compd.model import MachineModel, effect_deltas, machine_constants, observe, predict
from compd.model.effects import (
    Constant,
    Effect,
    FittedEffect,
    MachineDetails,
    Observations,
    Parameter,
    needed_quantities,
    unmet_needs,
)
from compd.model.kinematics import Movement, update_motion
from compd.reference_conditions import REFERENCE_PRESSURE_hPa
from compd.units import UM_PER_MM

# Drawn workspace: distances from machine zero that the shipped machines reach easily.
REACH_MM = 80.0
HEIGHT_MM = 40.0
# Place of the curves, off the middle, where symmetry hides much.
ASIDE_MM = (50.0, 30.0, 0.0)

# Drivers of an effect for the arrows, with typical values.
WARMING_K = 2.0
GRADIENT_K = 0.5
FORCE_N = 50.0
PRESSURE_hPa = REFERENCE_PRESSURE_hPa - 10.0
SPEED_MM_PER_S = 50.0
JOINT_READING_MM = 0.005
FRAME_READING_MM = 0.010
HOUR_S = 3600.0


@dataclass(frozen=True)
class Drive:
    """The state of the machine and its surroundings at N rows; every number may be one for all rows.

    tip_mm (N, 3), from machine zero's tip.  apart : rows do not follow one another, every link last moved outwards.
    warming_K : of every thermometer; gradient_K : of the plate's top.
    """

    tip_mm: FloatArray
    apart: bool = False
    warming_K: FloatArray = field(default_factory=lambda: np.array([WARMING_K]))
    gradient_K: FloatArray = field(default_factory=lambda: np.array([GRADIENT_K]))
    force_x_N: FloatArray = field(default_factory=lambda: np.array([FORCE_N]))
    force_z_N: FloatArray = field(default_factory=lambda: np.array([-FORCE_N]))
    pressure_hPa: FloatArray = field(default_factory=lambda: np.array([PRESSURE_hPa]))
    speed_mm_per_s: FloatArray = field(default_factory=lambda: np.array([SPEED_MM_PER_S]))
    joint_mm: FloatArray = field(default_factory=lambda: np.array([JOINT_READING_MM]))
    frame_mm: FloatArray = field(default_factory=lambda: np.array([FRAME_READING_MM]))
    time_s: FloatArray = field(default_factory=lambda: np.array([HOUR_S]))


class Curve(NamedTuple):
    """Tip error in um (N, 3) over what drives it (N,), whose name and unit the label gives."""

    label: str
    driven_by: FloatArray
    tip_um: FloatArray


class Signature(NamedTuple):
    """tip_mm (M, 3) in {M}, and the tip's error there, tip_um (M, 3); curves; parameter -> its value as text."""

    tip_mm: FloatArray
    tip_um: FloatArray
    curves: list[Curve]
    parameters: dict[str, str]


def compute_signature(effect: Effect, model: MachineModel, details: MachineDetails) -> Signature:
    """Arrows and curves of one effect with parameters from the middle of their plausible range.

    Raises CompdError if this machine lacks what the effect needs (a plate thickness, revolute axes).
    """
    needed = needed_quantities(effect, model.links)
    on_machine = _EffectOnMachine(effect, model, details, needed)
    lacking = unmet_needs(effect, on_machine.rows(Drive(np.zeros((1, 3)))).available, model.links)
    if lacking:
        raise CompdError(lacking)
    across = np.linspace(-REACH_MM, REACH_MM, 5)
    grid = np.stack(np.meshgrid(across, across, [-HEIGHT_MM, 0.0, HEIGHT_MM], indexing="ij"), axis=-1).reshape(-1, 3)
    grid = grid[np.hypot(grid[:, 0], grid[:, 1]) <= 1.05 * REACH_MM]
    curves = [Curve(label, values, on_machine.tip_um(drive)) for label, values, drive in _drives(effect, needed)]
    return Signature(
        grid + model.zero.contact.tip_M_mm,
        on_machine.tip_um(Drive(grid, apart=True)),
        curves,
        _parameter_values(effect, on_machine.fitted.constants),
    )


def typical_value(parameter: Parameter | Constant) -> float:
    """A plausible value: half the range if it is symmetric, its geometric middle if it spans decades; of a choice the
    first."""
    if isinstance(parameter, Constant) and parameter.choice:
        return parameter.grid[0]
    low, high = parameter.low, parameter.high
    if low < 0:
        return high / 2
    return float(np.sqrt(low * high)) if low > 0 and high / low > 10 else (low + high) / 2


def _parameter_values(effect: Effect, shape: Mapping[str, float]) -> dict[str, str]:
    values = {parameter.name: f"{typical_value(parameter):.3g} {parameter.unit}" for parameter in effect.parameters}
    units = {constant.name: constant.unit for constant in effect.constants}
    return values | {name: f"{value:.3g} {units[name]}" for name, value in shape.items()}


class _EffectOnMachine:
    """One effect on one machine."""

    def __init__(self, effect: Effect, model: MachineModel, details: MachineDetails, needed: Sequence[str]) -> None:
        self._model, self._needed = model, needed
        self._common = machine_constants(model, details)
        columns = effect.columns(model.links)
        theta = np.array([column.parameter.to_theta(typical_value(column.parameter)) for column in columns])
        if any(parameter.per == "link_axis" for parameter in effect.parameters):
            theta[1:] = 0.0  # all joints moved alike would only move the whole machine
        period = details.scale_signal_period_mm
        shape = {
            constant.name: period if constant.setting and not np.isnan(period) else typical_value(constant)
            for constant in effect.constants
        }
        self.fitted = FittedEffect(effect, theta, shape)

    def rows(self, drive: Drive) -> Observations:
        """The rows that a drive makes; gauges show what perfect ones would, but for `joint_mm` and `frame_mm`."""
        model, count = self._model, len(drive.tip_mm)
        scale_mm = model.reach(model.zero.contact.tip_M_mm + drive.tip_mm).scale_mm
        gauges = model.joint_weights.shape[1]
        ones = np.ones((count, 1))
        return observe(
            model,
            self._common,
            scale_mm=scale_mm,
            joint_mm=np.broadcast_to(drive.joint_mm[:, None] * ones, (count, gauges)).copy(),
            frame_mm=np.broadcast_to(drive.frame_mm[:, None] * ones, (count, 9)).copy(),
            quantities={name: np.broadcast_to(_value(name, drive), (count,)) for name in self._needed},
            time_s=np.broadcast_to(drive.time_s, (count,)),
            session_start=(np.arange(count) == 0) | drive.apart,
            movement=Movement(
                np.ones_like(scale_mm) if drive.apart else _directions(scale_mm),
                drive.speed_mm_per_s[:, None] * np.ones_like(scale_mm),
                np.zeros((count, gauges)),
            ),
        )

    def tip_um(self, drive: Drive) -> FloatArray:
        """(N, 3) by which the effect moves the tip."""
        rows = self.rows(drive)
        deltas, _ = effect_deltas(self.fitted, rows)
        with_effect = predict(self._model, rows, deltas)
        return np.asarray(UM_PER_MM * (with_effect.tip_mm - predict(self._model, rows, {}).tip_mm))


def _value(name: str, drive: Drive) -> FloatArray:
    if name == "temperature_plate_top_degC":
        return 20.0 + drive.gradient_K
    if name == "temperature_plate_bottom_degC":
        return np.array([20.0])
    if name.startswith("temperature_"):
        return 20.0 + drive.warming_K
    values = {"force_x_N": drive.force_x_N, "force_z_N": drive.force_z_N, "pressure_hPa": drive.pressure_hPa}
    return values.get(name, np.zeros(1))


def _directions(scale_mm: FloatArray) -> FloatArray:
    """Direction (+1 or -1) at each row in sequence; +1 before the first motion."""
    motion = None
    directions = np.empty_like(scale_mm)
    for row, scales in enumerate(scale_mm):
        motion = update_motion(motion, float(row), scales, np.zeros(0))
        directions[row] = np.where(motion.direction == 0, 1.0, motion.direction)
    return directions


def _drives(effect: Effect, needed: Sequence[str]) -> list[tuple[str, FloatArray, Drive]]:
    """Label, what is varied, and the rows, for everything that drives this effect."""
    count = 61
    here = np.tile(ASIDE_MM, (count, 1))

    def spread(low: float, high: float) -> FloatArray:
        return np.linspace(low, high, count)

    drives: list[tuple[str, FloatArray, Drive]] = []
    if "direction" in effect.needs:
        path = np.concatenate([spread(-40, 40), spread(40, -40), spread(-40, 40)])
        tips = np.outer(path, [1.0, 0.0, 0.0]) + ASIDE_MM
        drives.append(("x there and back, mm from the place", path, Drive(tips)))
    if effect.remembers and any(name.startswith("temperature") for name in needed):
        hours = spread(0, 6)
        warming = np.where(hours > 1.0, WARMING_K, 0.0)
        drives.append(
            (
                "time, h; the temperature steps after one hour",
                hours,
                Drive(here, warming_K=warming, time_s=hours * HOUR_S),
            )
        )
    elif any(name.startswith("temperature_plate") for name in needed):
        kelvin = spread(-1, 1)
        drives.append(("plate, top less bottom, K", kelvin, Drive(here, gradient_K=kelvin)))
    elif any(name.startswith("temperature") for name in needed):
        kelvin = spread(-3, 3)
        drives.append(("temperature above 20 degC, K", kelvin, Drive(here, warming_K=kelvin)))
    if "pressure_hPa" in needed:
        pressure = spread(980, 1040)
        drives.append(("pressure, hPa", pressure, Drive(here, pressure_hPa=pressure)))
    if "force" in effect.needs:
        force = spread(-100, 100)
        drives.append(("force along z, N", force, Drive(here, force_z_N=force)))
        drives.append(("force along x, N", force, Drive(here, force_x_N=force)))
    if "motion" in effect.needs:
        speed = spread(-100, 100)
        drives.append(("speed of all links, mm/s", speed, Drive(here, speed_mm_per_s=speed)))
    elif effect.needs == ("time",):
        hours = spread(0, 10)
        drives.append(("time, h", hours, Drive(here, time_s=hours * HOUR_S)))
    if effect.follows_reading:
        reading = spread(-0.02, 0.02)
        changed = Drive(here, joint_mm=reading) if effect.ports == ("joint",) else Drive(here, frame_mm=reading)
        drives.append(("reading of all comparators, mm", reading, changed))
    if any(constant.setting == "scale_signal_period_mm" for constant in effect.constants):
        short = spread(0, 0.06)
        drives.append(("z from the place, mm", short, Drive(here + np.outer(short, [0.0, 0.0, 1.0]))))
    for axis, name in enumerate("xyz"):
        reach = spread(-REACH_MM, REACH_MM) if axis < 2 else spread(-HEIGHT_MM, HEIGHT_MM)
        if not effect.remembers:
            drives.append((f"{name} through machine zero, mm", reach, Drive(np.outer(reach, np.eye(3)[axis]))))
    return drives
