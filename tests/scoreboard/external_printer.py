"""A machine that warms up for hours while one length is measured, simulated body by body."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from compd.arrays import FloatArray
from tests.scoreboard.case import Case
from tests.scoreboard.external_machine import UM, ExternalMachine, Recorded, rounded, sidecar

# Readings at each visit, their distance and that of visits, s; visits: least and most; noise, um.
READINGS, READING_S, VISIT_S, VISITS, NOISE_UM = 2, 2.0, 40.0, (120, 220), (0.5, 2.0)
# Rise, K, and time constant, s, of each body with a thermometer: least and most. A frame is heated by the bed.
BODIES: Mapping[str, tuple[tuple[float, float], tuple[float, float]]] = {
    "bed": ((35.0, 80.0), (150.0, 500.0)),
    "nozzle": ((120.0, 220.0), (40.0, 120.0)),
    "frame": ((4.0, 12.0), (1500.0, 5000.0)),
}
# What follows the bed later: its time constant, s. The room's wave, K and s. A thermometer's last digit, K.
LATER_S, ROOM_K, ROOM_S, ROOM_degC, DIGITS = (300.0, 2000.0), 0.3, 4000.0, 22.0, 2
# The formulas of the effects count from here.
SINCE_degC = 25.0
OFFSET_UM = 100.0


def record_printer(case: Case, number: int) -> Recorded:
    """One warm-up from cold: every body heats up once, and nothing cools down."""
    rng = case.rng("printer")
    noise_um, later_s = rng.uniform(*NOISE_UM), rng.uniform(*LATER_S)
    offset_um, sign = rng.uniform(-OFFSET_UM, OFFSET_UM), rng.choice((-1.0, 1.0))
    rng = case.rng(f"printer {number}")
    visits = int(rng.integers(*VISITS))
    time_s = np.repeat(np.arange(visits) * VISIT_S, READINGS) + np.tile(np.arange(READINGS) * READING_S, visits)
    room = ROOM_degC + ROOM_K * np.sin(2 * np.pi * time_s / ROOM_S + rng.uniform(0, 2 * np.pi))
    warm = {name: room + _risen(time_s, rng.uniform(*rise), rng.uniform(*tau)) for name, (rise, tau) in BODIES.items()}
    (name,), (floors,) = case.causes, case.floors
    body = name.split("_")[0]
    grown = _followed(time_s, warm[body], later_s) if name.endswith("_lag") else warm[body]
    strength = record_printer(case, 0).strengths[name] if number else rounded(sign * floors * noise_um / np.std(grown))
    error_um = offset_um + strength * (grown - SINCE_degC)
    noise = rng.normal(0, noise_um, len(time_s))
    columns = {
        "time_s": time_s,
        "visit": np.repeat(1.0 + np.arange(visits), READINGS),
        **{f"temperature_{place}_degC": np.round(values, DIGITS) for place, values in warm.items()},
        "temperature_room_degC": np.round(room, DIGITS),
        "model_z_mm": np.zeros(len(time_s)),
        "reference_z_mm": np.round(UM * (error_um + noise), 6),
    }
    return Recorded(columns, sidecar(), {name: strength}, float(np.sqrt(np.mean(noise**2))))


def _risen(time_s: FloatArray, rise_K: float, tau_s: float) -> FloatArray:
    """Of a body with one heat capacity that is switched on at time 0."""
    return np.asarray(-rise_K * np.expm1(-time_s / tau_s))


def _followed(time_s: FloatArray, source_degC: FloatArray, tau_s: float) -> FloatArray:
    """A body that takes its heat from another one, exact for a source that changes evenly between two rows."""
    followed = np.empty_like(source_degC)
    followed[0] = source_degC[0]
    for row in range(1, len(time_s)):
        step = (time_s[row] - time_s[row - 1]) / tau_s
        slope = (source_degC[row] - source_degC[row - 1]) / step
        steady = source_degC[row - 1] - slope
        followed[row] = steady + slope * step + (followed[row - 1] - steady) * np.exp(-step)
    return followed


PRINTER = ExternalMachine(
    ("bed_growth", "bed_growth_lag", "frame_growth", "nozzle_growth_lag"),
    ("gauge_offset",),
    Path(__file__).with_name("printer_effects.yaml"),
    "um/K",
    record_printer,
)
