"""A machine that measures points at rest: its gauges as a recording, and the points as an instrument has them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from compd.arrays import FloatArray
from compd.columns import frame_columns
from compd.instruments import InstrumentExport
from compd.recording import write_recording

SIDECAR = {"machine": "tripod-cmm"}
# What a machine without compensation is wrong by, and the instrument's noise.
MACHINE_MM, NOISE_MM = 0.02, 0.005
# Where the instrument stands: nobody tells the join.
TURNED = Rotation.from_rotvec([0.4, -0.9, 1.3]).as_matrix()
MOVED_MM = np.array([2500.0, -800.0, 310.0])


def write_gauges(path: Path, time_s: FloatArray | None, scale_mm: FloatArray, **extra: FloatArray) -> Path:
    """A recording of gauges alone, with or without times; comparators that do not move."""
    columns = {} if time_s is None else {"time_s": time_s}
    columns |= {f"scale_{i + 1}_mm": scale_mm[:, i] for i in range(3)}
    columns |= {f"joint_{k}_um": np.zeros(len(scale_mm)) for k in range(1, 10)}
    columns |= {name: np.zeros(len(scale_mm)) for name in frame_columns(9)}
    write_recording(path, {**columns, **extra}, SIDECAR)
    return path


def in_own_frame(tip_M_mm: FloatArray) -> FloatArray:
    """(N, 3) points in the instrument's frame."""
    return np.asarray(tip_M_mm @ TURNED.T + MOVED_MM)


def random_places(rng: np.random.Generator, count: int) -> FloatArray:
    """(count, 3) places within 100 mm."""
    return rng.uniform(-100, 100, (count, 3))


def measured(rng: np.random.Generator, place_mm: FloatArray, error_mm: float = MACHINE_MM) -> FloatArray:
    """The points that an instrument shows of places, each of which the machine reaches with an error of its own."""
    return in_own_frame(place_mm + rng.normal(0.0, error_mm, place_mm.shape)) + rng.normal(0, NOISE_MM, place_mm.shape)


def points(measured_mm: FloatArray, names: list[str] | None = None) -> InstrumentExport:
    """An export of points, or of lengths (N, 1), without time, whose first point stands in line 2."""
    axes = ("length",) if measured_mm.shape[1] == 1 else ("x", "y", "z")
    line = np.arange(2, len(measured_mm) + 2)
    return InstrumentExport(
        Path("points.csv"), "csv", line, axes, measured_mm, name=None if names is None else tuple(names)
    )
