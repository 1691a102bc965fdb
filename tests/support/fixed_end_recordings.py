"""Recordings of lengths from fixed balls, and of pins, at places that the recording does not say."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from compd.comparison import AlignedRecording
from compd.recording import write_recording
from tests.support.measured import SIGMA_UM, Floats, aligned, gauges, tips_mm, tripod

DISTANCE = {"quantity": "distance", "sigma_um": SIGMA_UM}
PINS = {"quantity": "fixed_point", "sigma_um": SIGMA_UM}


def recorded(directory: Path, reference: dict[str, Any], effects: tuple[Any, ...] = (), rows: int = 240) -> Path:
    """A tripod's gauges in random order of places, beside a laser tracer's lengths from two balls, or beside pins."""
    columns = gauges(rows, 21)
    rng = np.random.default_rng(2)
    if reference["quantity"] == "fixed_point":
        for i in (1, 2, 3):
            columns[f"scale_{i}_mm"] = 15.0 * (i - 2) + 10.0 * (np.arange(rows) // 3 % 4)
        columns |= {name: np.zeros(rows) for name in columns if name.startswith(("joint_", "frame_"))}
    truth_mm = tips_mm(directory, columns, effects, tripod(), "tripod-cmm")
    if reference["quantity"] == "distance":
        balls_mm = np.array([[150.0, 40.0, 20.0], [-120.0, 90.0, 260.0]])
        ball = np.arange(rows) // 3 % 2
        distance_mm = np.linalg.norm(truth_mm - balls_mm[ball], axis=1) - 0.25
        measured = {"ball": 1.0 + ball, "reference_distance_mm": distance_mm + rng.normal(0, SIGMA_UM / 1e3, rows)}
    else:
        # the machine goes to the pin: its scales take what the effects do, and the seat's noise
        nominal = _blank_columns(directory, columns)
        off_mm = truth_mm - nominal.nominal_tip_mm + rng.normal(0, SIGMA_UM / 1e3, (rows, 3))
        by_scale = nominal.sensitivity(["scale"])["scale"].tip
        taken = np.linalg.solve(by_scale, off_mm[:, :, None])[:, :, 0]
        for i in (1, 2, 3):
            columns[f"scale_{i}_mm"] = columns[f"scale_{i}_mm"] - taken[:, i - 1]
        measured = {"pin": 1.0 + np.arange(rows) // 3 % 4}
    path = directory / "run.csv"
    write_recording(path, {**columns, **measured}, {"machine": "tripod-cmm", "reference": reference}, overwrite=True)
    return path


def _blank_columns(directory: Path, columns: dict[str, Floats]) -> AlignedRecording:
    path = directory / "nominal.csv"
    nothing = {f"reference_{axis}_mm": np.arange(len(columns["time_s"])) * 1e-3 for axis in "xyz"}
    sidecar = {"machine": "tripod-cmm", "reference": {"quantity": "tool_position", "frame": "machine"}}
    write_recording(path, {**columns, **nothing}, sidecar, overwrite=True)
    return aligned(path)
