"""Recordings of machines that compd does not know: columns, a model's prediction of zero, and an error to describe."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from compd.arrays import FloatArray
from compd.comparison.aligned_recording import AlignedRecording, align_recording
from compd.comparison.open import read_with_machine

SIDECAR = "machine: external\nreference: {{quantity: tool_position, frame: {frame}, sigma_um: 1.0}}\n"


def record_external(
    path: Path, columns: Mapping[str, FloatArray], error_um: Mapping[str, FloatArray], frame: str = "machine"
) -> AlignedRecording:
    """A recording, written and read: one row a minute unless `columns` have the time; nan is an empty cell.

    error_um : what the reference shows by axis; the model predicts 0.
    """
    count = len(next(iter(error_um.values())))
    table = {"time_s": 60.0 * np.arange(count), **columns}
    table |= {f"model_{axis}_mm": np.zeros(count) for axis in error_um}
    table |= {f"reference_{axis}_mm": error / 1e3 for axis, error in error_um.items()}
    lines = [",".join(table)]
    lines += [",".join("" if np.isnan(v) else repr(float(v)) for v in row) for row in zip(*table.values(), strict=True)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    path.with_suffix(".yaml").write_text(SIDECAR.format(frame=frame), encoding="utf-8")
    return align_recording(*read_with_machine(path, None))


def residual_um(aligned: AlignedRecording) -> FloatArray:
    """(N, m) what the model leaves without any effect."""
    return (aligned.measured_mm - aligned.predicted_mm({})) * 1e3
