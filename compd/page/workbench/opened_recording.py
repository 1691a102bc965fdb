"""An open recording with its machine's model, as data for a browser."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from compd.arrays import FloatArray, IntArray, rms
from compd.comparison import AlignedRecording, Comparison, compare, open_whole_or_sample
from compd.configuration import Machine
from compd.model_file import ModelFile, read_model_file
from compd.page.packed import packed
from compd.plugins import NO_CODE
from compd.report import machine_lines
from compd.text import nan_to_null, typeset
from compd.units import unit_of

# Approximate limit of rows in pictures; numbers always use all rows.
MAX_PICTURED = 5000
# States of a row, in the order of their codes.
ROW_STATES = ("used", "outlier", "left out")
_SEED = 1


@dataclass(frozen=True, eq=False)
class OpenedRecording:
    """One recording against one model; a change of either makes another.

    path, model_path : of the recording and of the model file, which need not be there yet.
    aligned : its rows; of a recording that is too long for the memory a sample.
    start : the comparison without any effect, from which the error falls.
    """

    path: Path
    model_path: Path
    aligned: AlignedRecording
    model: ModelFile
    start: Comparison

    @cached_property
    def comparison(self) -> Comparison:
        """The comparison of the recording with the present model."""
        if not self.model.fitted:
            return self.start
        return compare(self.aligned, self.model.fitted, self.model.covariance)

    @cached_property
    def pictured(self) -> IntArray:
        """(R,) rows shown in pictures, ascending: all, or an even selection."""
        count = len(self.aligned.rows)
        if count <= MAX_PICTURED:
            return np.arange(count)
        stretches = np.array_split(np.arange(count), MAX_PICTURED)
        rng = np.random.default_rng(_SEED)
        return np.array([rng.choice(stretch) for stretch in stretches])

    @property
    def places_mm(self) -> FloatArray:
        """(N, 3) tip positions without effects, mm."""
        return self.aligned.nominal_tip_mm

    def summary(self) -> dict[str, Any]:
        """The numbers of the comparison, the model's numbers and its ledger, as plain data."""
        comparison = self.comparison
        summary = {
            "recording": self.path.stem,
            "machine": self.aligned.recording.machine,
            "labels": self.aligned.labels,
            "unit": self.aligned.unit,
            "rows": len(self.aligned.rows),
            "sample": comparison.basis,
            "rms": comparison.rms_um,
            "fall": fall(self.start, comparison),
            "floor": comparison.floor.um,
            "floor_known": comparison.floor.known,
            "floor_how": comparison.floor.how,
            "floor_ratio": comparison.floor_ratio,
            "at_floor": comparison.at_floor,
            "verdict": comparison.verdict,
            "trends": [trend.text for trend in comparison.trends],
            "used": int(comparison.used.sum()),
            "left_out": dict(comparison.left_out),
            "faults": [fault.text for fault in comparison.faults],
            "excluded": {str(row): reason for row, reason in self.aligned.recording.sidecar.excluded.items()},
            "numbers": [vars(number) | {"plausible": number.plausible} for number in self.model.numbers()],
            "ledger": [
                {
                    "kind": step.kind,
                    "effect": step.effect,
                    "date": step.date,
                    "recording": step.recording,
                    "before": step.rms_before_um,
                    "after": step.rms_after_um,
                    "floor": step.noise_floor_um,
                    "unit": step.unit,
                    "undone": step.undone,
                }
                for step in self.model.steps
            ],
        }
        plain: dict[str, Any] = nan_to_null(summary)
        return plain

    def rows(self, *, all_rows: bool = False) -> bytes:
        """Data of each row for pictures: number, time, position, residual, state, session and quantities.

        all_rows : all of them; else those in pictures.
        """
        aligned, comparison = self.aligned, self.comparison
        chosen = np.arange(len(aligned.rows)) if all_rows else self.pictured
        recording = aligned.recording
        state = np.where(comparison.used, 0.0, np.where(comparison.outlier, 1.0, 2.0))
        session = np.zeros(len(state)) if recording.session is None else recording.session
        arrays = {
            "row": recording.row.astype(np.float64),
            "time_s": recording.elapsed_s,
            "place_mm": self.places_mm,
            "residual": comparison.residual_um,
            "start": self.start.residual_um,
            "start_used": self.start.used.astype(np.float64),
            "state": state,
            "session": session.astype(np.float64),
            **{f"quantity {name}": values for name, values in aligned.rows.quantities.items()},
        }
        header = {
            "labels": aligned.labels,
            "unit": aligned.unit,
            "units": [aligned.unit_of(label) for label in aligned.labels],
            "time_title": "time since the first row, s" if recording.has_time else "row in order",
            "quantity_titles": {f"quantity {name}": _axis_title(name) for name in aligned.rows.quantities},
            "machine": [] if aligned.model is None else machine_lines(aligned.model),
            "states": ROW_STATES,
            "rows": len(state),
        }
        return packed(header, {name: values[chosen] for name, values in arrays.items()})


def _axis_title(quantity: str) -> str:
    """Name and unit of a measured quantity: "force_z_N" is "force z, N"."""
    unit = unit_of(quantity)
    name = quantity.removesuffix(f"_{unit}").replace("_", " ") if unit else quantity
    return f"{name}, {typeset(unit)}" if unit not in ("", "1") else name


def fall(before: Comparison, after: Comparison) -> dict[str, Any]:
    """The error of two states of the same recording, on the rows that count in both.

    `rms` : before and after, um per coordinate.  `rows` : how many count in both.
    `differ` : in words which rows count in one state alone; "" where both have the same.
    """
    both, lengths = before.used & after.used, before.aligned.lengths
    lost, won = int((before.used & ~after.used).sum()), int((after.used & ~before.used).sum())
    texts = [f"{lost} that counted before are left out after"] * bool(lost)
    texts += [f"{won} that were left out before count after"] * bool(won)
    differ = f"of the {both.sum()} rows that count in both; {' and '.join(texts)}" if texts else ""
    errors_um = [rms(state.residual_um[both][:, lengths]) for state in (before, after)]
    return {"rms": errors_um, "rows": int(both.sum()), "differ": differ}


def open_for_page(path: Path, model_path: Path, machine: Machine | None = None) -> OpenedRecording:
    """Open a recording and the model of its machine; a missing model file gives a new model.

    Of a recording that is too long for the memory a sample is opened, spread evenly.
    Raises CompdError with every problem of either.
    """
    aligned = open_whole_or_sample(path, machine)
    model = model_of(model_path, aligned)
    return OpenedRecording(path, model_path, aligned, model, compare(aligned, ()))


def model_of(path: Path | None, aligned: AlignedRecording) -> ModelFile:
    """The model of a recording's machine, from the file or new if that is missing.

    Raises CompdError, also where an effect is code: a browser can bring a model file, and the page runs none.
    """
    name, links = aligned.recording.machine, aligned.rows.links
    if path is None or not path.exists():
        return ModelFile(name, links)
    return read_model_file(path, name, links, code=NO_CODE)
