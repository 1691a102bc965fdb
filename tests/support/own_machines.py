"""Two simulated machines that compd does not know, with the formulas of their effects."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from typing import Any

import numpy as np
import yaml

from compd.arrays import FloatArray
from compd.units import UM_PER_MM
from tests.support.changed_recordings import RecordingFile

NOISE_UM = 1.0
VISITS, REPEATS = 60, 3

TABLE_EFFECTS = yaml.safe_load("""
- id: table_rotation
  port: reference
  physics: the table lies turned
  formula: {x: -r * nominal_y_mm, y: r * nominal_x_mm}
  parameters: {r: {unit: um/mm, plausible: [-20, 20], source: clamping}}
- id: table_scale
  port: reference
  physics: both screws have the same wrong lead
  formula: {x: s * nominal_x_mm, y: s * nominal_y_mm}
  parameters: {s: {unit: um/mm, plausible: [-2, 2], source: lead}}
- id: table_squareness
  port: reference
  physics: the axes are not square
  formula: {x: q * nominal_y_mm}
  parameters: {q: {unit: um/mm, plausible: [-2, 2], source: assembly}}
- id: table_offset
  port: reference
  physics: the table lies elsewhere
  formula: {x: a, y: b}
  parameters:
    a: {unit: um, plausible: [-5000, 5000], source: clamping}
    b: {unit: um, plausible: [-5000, 5000], source: clamping}
- id: screw_expansion
  port: reference
  physics: the screw of x warms up with the spindle
  formula: {x: a * (spindle_degC - 20) * nominal_x_mm / 1000}
  parameters: {a: {unit: ppm/K, plausible: [0, 30], source: steel}}
- id: column_expansion
  port: reference
  physics: the column warms up with the spindle
  formula: {y: a * (spindle_degC - 20)}
  parameters: {a: {unit: um/K, plausible: [-20, 20], source: cast iron}}
- id: backlash_x
  port: reference
  physics: play of the screw of x
  formula: {x: b * moved_x_1}
  parameters: {b: {unit: um, plausible: [0, 20], source: screw}}
- id: backlash_y
  port: reference
  physics: play of the screw of y
  formula: {y: b * moved_y_1}
  parameters: {b: {unit: um, plausible: [0, 20], source: screw}}
""")

AXIS_EFFECTS = yaml.safe_load("""
- id: axis_play
  port: reference
  axis: x
  physics: play of the worm
  formula: p * moved_1
  parameters: {p: {unit: urad, plausible: [-100, 100], source: worm}}
- id: axis_windup
  port: reference
  axis: x
  physics: the shaft winds up under the moment
  formula: k * moment_N_m
  parameters: {k: {unit: urad/N/m, plausible: [-50, 50], source: shaft}}
- id: axis_eccentricity
  port: reference
  axis: x
  physics: the disc sits beside its centre
  formula: a * sin(angle_deg * pi / 180) + b * cos(angle_deg * pi / 180)
  parameters:
    a: {unit: urad, plausible: [-500, 500], source: mounting}
    b: {unit: urad, plausible: [-500, 500], source: mounting}
- id: axis_warmth
  port: reference
  axis: x
  physics: the housing warms up
  formula: c * (temperature_housing_degC - 20)
  parameters: {c: {unit: urad/K, plausible: [-20, 20], source: housing}}
""")


def milling_table(seed: int, hidden: Mapping[str, float]) -> RecordingFile:
    """VISITS places of a milling table, each measured REPEATS times with NOISE_UM while the spindle warms up.

    hidden : size of `table_scale`, `table_squareness`, `screw_expansion`, `backlash_x` as their formulas say; of
        `humidity`, which no formula knows, in um/pct along x.
    """
    rng = np.random.default_rng(seed)
    time_s = _visit_times_s()
    nominal_mm = _repeated(np.round(rng.uniform(-200, 200, (2, VISITS)), 3))
    moved = _repeated(rng.choice((-1.0, 1.0), (2, VISITS)))
    spindle = np.round(20 + 6 * (1 - np.exp(-time_s / 1200)) + 0.8 * np.sin(time_s / 300), 3)
    humidity = np.round(50 + 8 * np.sin(time_s / 250 + 2), 2)
    size = defaultdict(float, hidden)
    error_um = size["table_scale"] * nominal_mm + rng.normal(0, NOISE_UM, nominal_mm.shape)
    error_um[0] += size["table_squareness"] * nominal_mm[1] + size["backlash_x"] * moved[0]
    error_um[0] += size["screw_expansion"] * (spindle - 20) * nominal_mm[0] / 1000 + size["humidity"] * (humidity - 50)
    measured_mm = np.round(nominal_mm + error_um / UM_PER_MM, 6)
    columns = {
        "time_s": time_s,
        "visit": _repeated(np.arange(VISITS, dtype=float)),
        "nominal_x_mm": nominal_mm[0],
        "nominal_y_mm": nominal_mm[1],
        "moved_x_1": moved[0],
        "moved_y_1": moved[1],
        "spindle_degC": spindle,
        "temperature_room_degC": np.round(20 + 0.7 * np.sin(time_s / 700 + 1), 3),
        "humidity_pct": humidity,
        "load_kg": _repeated(np.round(rng.uniform(0, 30, VISITS), 1)),
        "model_x_mm": nominal_mm[0],
        "model_y_mm": nominal_mm[1],
        "reference_x_mm": measured_mm[0],
        "reference_y_mm": measured_mm[1],
    }
    reference: dict[str, Any] = {"quantity": "tool_position", "frame": "machine", "sigma_um": NOISE_UM}
    return RecordingFile(columns, {"machine": "external", "reference": reference}, tuple(TABLE_EFFECTS))


def rotary_axis(seed: int, play_urad: float, windup_urad: float) -> RecordingFile:
    """VISITS angles of a rotary axis, measured REPEATS times by an autocollimator with a noise of 1 urad."""
    rng = np.random.default_rng(seed)
    time_s = _visit_times_s()
    moved, moment = _repeated(rng.choice((-1.0, 1.0), VISITS)), _repeated(np.round(rng.uniform(-5, 5, VISITS), 2))
    error_urad = play_urad * moved + windup_urad * moment + rng.normal(0, 1.0, len(time_s))
    columns = {
        "time_s": time_s,
        "visit": _repeated(np.arange(VISITS, dtype=float)),
        "angle_deg": _repeated(np.round(rng.uniform(0, 360, VISITS), 2)),
        "moved_1": moved,
        "moment_N_m": moment,
        "temperature_housing_degC": np.round(20 + 3 * (1 - np.exp(-time_s / 1500)), 2),
        "model_x_urad": np.zeros(len(time_s)),
        "reference_x_urad": np.round(error_urad, 3),
    }
    reference = {"quantity": "tool_position", "unit": "urad", "sigma": 1.0}
    return RecordingFile(columns, {"machine": "external", "reference": reference}, tuple(AXIS_EFFECTS))


def _visit_times_s() -> FloatArray:
    """A visit every 40 s, its repeats 3 s apart."""
    return np.asarray(_repeated(np.arange(VISITS) * 40.0) + np.tile(np.arange(REPEATS) * 3.0, VISITS))


def _repeated(of_visit: FloatArray) -> FloatArray:
    """What is the same for all rows of a visit."""
    return np.repeat(of_visit, REPEATS, axis=-1)
