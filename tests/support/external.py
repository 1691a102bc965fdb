"""Recordings of machines of one's own: the model's prediction beside the reference, and anything else measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compd.recording import write_recording

Floats = NDArray[np.float64]


def write_external(
    directory: Path,
    columns: Mapping[str, Floats],
    reference: Mapping[str, Any] | None = None,
    folds: str | Sequence[str] | None = None,
    name: str = "run",
) -> Path:
    """Write NAME.csv and NAME.yaml: these columns, a row a second unless `time_s` is among them."""
    rows = len(next(iter(columns.values())))
    reference = {"quantity": "tool_position", "frame": "machine"} if reference is None else reference
    contents: dict[str, Any] = {"machine": "external", "reference": reference}
    if folds is not None:
        contents["folds"] = folds
    path = directory / f"{name}.csv"
    write_recording(path, {"time_s": np.arange(rows, dtype=float), **columns}, contents, overwrite=True)
    return path


def measured_places(axes: str = "xy", count: int = 60, seed: int = 5) -> dict[str, Floats]:
    """Places in mm, each measured twice, the second time long after, within 1 um; and a number that belongs to each."""
    rng = np.random.default_rng(seed)
    columns: dict[str, Floats] = {}
    for axis in axes:
        columns[f"model_{axis}_mm"] = np.round(np.tile(rng.uniform(-100, 100, count), 2), 6)
        columns[f"reference_{axis}_mm"] = columns[f"model_{axis}_mm"] + rng.normal(0, 1e-3, 2 * count)
    columns["hole_mm"] = np.tile(rng.integers(1, 5, count) * 1.5, 2)
    return columns
