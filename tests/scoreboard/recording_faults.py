"""What happens to a recording after it was measured: gross rows, useless sensors, steps, another frame or target."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from compd.arrays import FloatArray
from compd.columns import POSITION_COLUMNS
from compd.simulation.truth.instruments import TRACKER_SIGMA_UM

UM = 1e-3
Columns = Mapping[str, FloatArray]
# Rows with a glint, and rows of a run in which the instrument followed a wrong reflection.
GLINT_SHARE, GLINT_RUN = 0.04, 18
GLINT_UM, GLINT_FREEDOM = 4.0, 2.0
# A constant on x, y, z, in floors.
SHIFT_FLOORS = (20.0, -14.0, 8.0)
# An instrument beside the machine: tilt of its axis, rad, and distance, mm.
TILT_RAD, DISTANCE_MM = 0.005, 800.0
# Correlation time of noise that wanders and comes back, s: 0.95 from one visit to the next.
WANDER_S = 500.0
WANDER_FLOORS = (2.0, 6.0)
# Steps of a display, um, larger than what the tracker scatters.
STEPS_UM = (0.5, 1.0, 2.0)
# By how much a target that is mounted again sits elsewhere, rms of its coordinates in floors.
MOUNTING_FLOORS = (4.0, 12.0)


def reference_mm(columns: Columns) -> FloatArray:
    """(N, 3) the tip as measured."""
    return np.column_stack([columns[name] for name in POSITION_COLUMNS])


def with_reference(columns: Columns, measured_mm: FloatArray) -> dict[str, FloatArray]:
    """The columns with another reference, (N, 3)."""
    return {**columns, **dict(zip(POSITION_COLUMNS, np.round(measured_mm, 6).T, strict=True))}


def with_glints(columns: Columns, rng: np.random.Generator) -> dict[str, FloatArray]:
    """Replace the errors of GLINT_SHARE of the rows, and of one run, by Student's t of GLINT_UM."""
    measured_mm = reference_mm(columns)
    gross = rng.random(len(measured_mm)) < GLINT_SHARE
    begin = rng.integers(len(measured_mm) - GLINT_RUN)
    gross[begin : begin + GLINT_RUN] = True
    measured_mm[gross] += GLINT_UM * UM * rng.standard_t(GLINT_FREEDOM, (int(gross.sum()), 3))
    return with_reference(columns, measured_mm)


def with_shift(columns: Columns) -> dict[str, FloatArray]:
    """Add SHIFT_FLOORS to all rows."""
    return with_reference(columns, reference_mm(columns) + TRACKER_SIGMA_UM * UM * np.array(SHIFT_FLOORS))


def with_wander(columns: Columns, rng: np.random.Generator, comes_back: bool) -> dict[str, FloatArray]:
    """Add correlated noise to each axis: an autoregressive process of the first order, or a random walk.

    Its size is drawn from WANDER_FLOORS. Its increments follow the time that passes between two rows.
    """
    passed_s = np.diff(columns["time_s"], prepend=0.0)
    kept = np.exp(-passed_s / WANDER_S) if comes_back else np.ones_like(passed_s)
    size = np.sqrt(1 - kept**2) if comes_back else np.sqrt(np.minimum(passed_s, WANDER_S))
    steps = size[:, None] * rng.standard_normal((len(passed_s), 3))
    walk = np.zeros_like(steps)
    for row in range(1, len(walk)):
        walk[row] = kept[row] * walk[row - 1] + steps[row]
    walk -= walk.mean(axis=0)
    rms_um = rng.uniform(*WANDER_FLOORS) * TRACKER_SIGMA_UM
    return with_reference(columns, reference_mm(columns) + rms_um * UM * walk / np.sqrt(np.mean(walk**2)))


def in_instrument_frame(columns: Columns, rng: np.random.Generator) -> dict[str, FloatArray]:
    """The reference as an instrument shows it that stands somewhere beside the machine and is turned anyhow."""
    turn = Rotation.from_euler("zxy", [rng.uniform(0, 2 * np.pi), *rng.uniform(-TILT_RAD, TILT_RAD, 2)])
    return with_reference(columns, turn.apply(reference_mm(columns)) + rng.uniform(-DISTANCE_MM, DISTANCE_MM, 3))


def without(columns: Columns, pattern: str) -> dict[str, FloatArray]:
    """The columns whose names do not match the regular expression."""
    return {name: values for name, values in columns.items() if not re.fullmatch(pattern, name)}


def with_distractors(columns: Columns, rng: np.random.Generator) -> dict[str, FloatArray]:
    """Ten sensors more that have nothing to do with the error: noise, slow walks, waves, switches."""
    time_s = columns["time_s"]
    count = len(time_s)
    extra: dict[str, FloatArray] = {}
    for name in ("vibration_floor_um", "current_spindle_A", "flow_coolant_l_per_min"):
        extra[name] = rng.normal(0, 1, count)
    for name in ("temperature_cabinet_degC", "temperature_coolant_degC", "co2_room_ppm"):
        extra[name] = 20 + np.cumsum(rng.normal(0, 0.1, count))
    for name in ("voltage_mains_V", "level_oil_mm"):
        extra[name] = np.sin(2 * np.pi * time_s / rng.uniform(1e3, 2e4) + rng.uniform(0, 6)) + rng.normal(0, 0.1, count)
    for name in ("door_open_1", "pump_on_1"):
        extra[name] = (np.cumsum(rng.random(count) < 0.02) % 2).astype(float)
    return {**columns, **{name: np.round(values, 4) for name, values in extra.items()}}


def in_steps(columns: Columns, rng: np.random.Generator) -> dict[str, FloatArray]:
    """The reference rounded to a step that is drawn from STEPS_UM."""
    step_mm = float(rng.choice(STEPS_UM)) * UM
    return with_reference(columns, np.round(reference_mm(columns) / step_mm) * step_mm)


def with_target_re_mounted(columns: Columns, rng: np.random.Generator) -> tuple[dict[str, FloatArray], float]:
    """The target sits elsewhere from the beginning of one of the sessions on; also when that is, s."""
    session = columns["session"]
    later = session >= rng.choice(np.unique(session)[1:])
    direction = rng.standard_normal(3)
    moved_mm = rng.uniform(*MOUNTING_FLOORS) * TRACKER_SIGMA_UM * UM * direction / np.sqrt(np.mean(direction**2))
    moved = with_reference(columns, reference_mm(columns) + later[:, None] * moved_mm)
    return moved, float(columns["time_s"][later].min())


def on_a_plane(columns: Columns, places_mm: FloatArray) -> dict[str, FloatArray]:
    """The rows of touched places (P, 3), by their height alone, which is the same everywhere."""
    place = columns["point"].astype(int) - 1
    kept = {name: values for name, values in columns.items() if name != "pin"}
    return {**kept, POSITION_COLUMNS[2]: places_mm[place, 2]}


def rms_um(columns: Columns, before: Columns) -> float:
    """By how much the reference was changed, rms per coordinate."""
    return float(np.sqrt(np.mean((reference_mm(columns) - reference_mm(before)) ** 2)) / UM)
