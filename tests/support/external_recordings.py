"""Recordings of a machine of an external model whose error is known, for tests."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from compd.arrays import FloatArray
from compd.comparison import AlignedRecording
from compd.comparison.alignment.align_recording import align_recording
from compd.model import observe_external
from compd.model.effects import Effect, Observations
from compd.model.formula import formula_effect
from compd.model.kinematics import Movement
from compd.recording import read_recording

SIGMA_UM = 0.5


def record_external(
    path: Path,
    columns: Mapping[str, FloatArray],
    errors_um: Mapping[str, FloatArray],
    *,
    model_mm: Mapping[str, FloatArray] | None = None,
    sigma_um: float = SIGMA_UM,
    declared_um: float | None = SIGMA_UM,
    seed: int = 1,
    frame: str = "machine",
) -> AlignedRecording:
    """A recording, written and read: what was measured besides, and the error along each axis to which noise is added.

    columns : without `time_s` a row is measured every ten seconds; nan is an empty cell.
    model_mm : the prediction by axis; 0 if left out.  sigma_um : of the noise.  declared_um : of the noise, as the
    sidecar says; None where it says nothing.
    """
    rng = np.random.default_rng(seed)
    count = len(next(iter(errors_um.values())))
    table = {"time_s": 10.0 * np.arange(count), **columns}
    for axis, error_um in errors_um.items():
        predicted_mm = np.zeros(count) if model_mm is None else model_mm[axis]
        table[f"model_{axis}_mm"] = predicted_mm
        table[f"reference_{axis}_mm"] = predicted_mm + 1e-3 * (error_um + rng.normal(0, sigma_um, count))
    lines = [",".join(table)]
    lines += [",".join("" if np.isnan(v) else f"{v:.9g}" for v in row) for row in zip(*table.values(), strict=True)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    reference: dict[str, object] = {"quantity": "tool_position", "frame": frame}
    if declared_um is not None:
        reference["sigma_um"] = declared_um
    path.with_suffix(".yaml").write_text(yaml.safe_dump({"machine": "external", "reference": reference}))
    return align_recording(read_recording(path, None), None)


def along(axis: str, effect_id: str, formula: str, **keys: Any) -> Effect:
    """An effect along one axis with one parameter k; keys : others of its declaration."""
    parameters = {"k": {"unit": "um", "plausible": [-100, 100], "source": "a test"}}
    declaration = {"id": effect_id, "port": "reference", "axis": axis, "formula": formula, "parameters": parameters}
    return formula_effect({**declaration, **keys}, "a test")


def external_rows(
    tip_M_mm: FloatArray,
    quantities: Mapping[str, FloatArray],
    *,
    links: int = 0,
    recorded: Collection[str] = ("time", "order"),
    time_s: FloatArray | None = None,
) -> Observations:
    """Rows (N,) of such a machine, an hour apart; its links moved forwards at 1 mm/s, as far as that was recorded."""
    count = len(tip_M_mm)
    return observe_external(
        tip_M_mm,
        scale_mm=np.full((count, links), 5.0),
        movement=Movement(np.ones((count, links)), np.ones((count, links)), np.zeros((count, 0))),
        quantities=quantities,
        time_s=3600.0 * np.arange(count) if time_s is None else time_s,
        session_start=np.arange(count) == 0,
        recorded=frozenset(recorded),
    )
