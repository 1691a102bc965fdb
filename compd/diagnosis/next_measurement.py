"""The next measurement: rows on which two rivals part, chosen one programme after another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from compd.arrays import FloatArray
from compd.comparison.aligned_recording import AlignedRecording
from compd.diagnosis.measurement_programmes import ProgrammeLimits, Segment, rows_of, segments
from compd.diagnosis.regression import solve
from compd.errors import Problem, RecordingError
from compd.model.effect import FittedEffect
from compd.model.effect_needs import needed_quantities
from compd.model.observations import Observations
from compd.model.sensitivity import effect_sensitivity, sensitivities
from compd.recording.plan_file import plan_row, plan_text, write_plan_file
from compd.units import UM_PER_MM

# Rows of one purpose teach less and less; what was measured already keeps its weight.
RIDGE = 1e-9


@dataclass(frozen=True)
class MeasurementPlan:
    """Rows to measure: name -> values; what for; by how much the rivals will differ.

    separation : of each rival from the other after the measurement, in standard deviations of the noise, whole plan;
    before : the same on the recording alone.
    """

    rivals: tuple[str, str]
    rows: tuple[dict[str, Any], ...]
    separation: float
    before: float

    def write_to(self, stream: TextIO) -> None:
        """As CSV."""
        stream.write(plan_text(self.rows))

    def write(self, path: Path) -> None:
        """As CSV. Raises RecordingError where it cannot be written."""
        write_plan_file(path, self.rows)


class _Parting:
    """One rival's effect, and how well the other can imitate it on all rows so far: least squares that grow."""

    def __init__(self, truth: FloatArray, imitation: FloatArray) -> None:
        self.normal = imitation.T @ imitation
        self.score = imitation.T @ truth
        self.square = float(truth @ truth)

    def left(self, normal: FloatArray, score: FloatArray, square: FloatArray) -> FloatArray:
        """(K,) squares that cannot be imitated after adding each of K programmes."""
        total = self.normal + normal
        right = self.score + score
        ridge = np.broadcast_to(RIDGE * np.diag(self.normal) + 1e-12, right.shape)
        return np.asarray(self.square + square - (right * solve(total, right, ridge)).sum(axis=-1))

    def add(self, normal: FloatArray, score: FloatArray, square: float) -> None:
        self.normal, self.score, self.square = self.normal + normal, self.score + score, self.square + square


def plan(
    aligned: AlignedRecording,
    model: Sequence[FittedEffect],
    pair: tuple[FittedEffect, FittedEffect],
    sigma_um: FloatArray,
    limits: ProgrammeLimits,
    rows: int,
) -> MeasurementPlan:
    """The rows that separate two fitted rivals best, greedily: each programme adds most per row to the worse direction.

    model : the model's own effects, fitted along.  sigma_um : (m,) noise.  rows : how many may be measured.
    (T-optimality: Atkinson and Fedorov, Biometrika 62 (1975) 57: the rival is refitted on every trial.)
    Raises RecordingError where nothing can be planned.
    """
    if aligned.model is None:
        raise RecordingError(
            Problem(
                where=str(aligned.recording.path),
                what="of an external model's machine no measurement can be planned",
                next_step="write a machine configuration",
            )
        )
    links = aligned.rows.links
    names = list(dict.fromkeys(name for one in pair for name in needed_quantities(one.effect, links)))
    programmes = [one for one in segments(aligned, limits, names) if len(one) <= rows]
    fresh = rows_of(aligned.model, aligned.rows.constants, programmes, aligned)
    ports = {port for one in (*model, *pair) for port in one.effect.ports}
    by = sensitivities(aligned.model, fresh, ports)

    def of(one: FittedEffect) -> FloatArray:
        basis, _ = one.effect.basis(fresh, one.constants, None)
        found = effect_sensitivity(one.effect, fresh, basis, by)
        return (
            (found.link_length if aligned.of_links else found.tip)[:, list(aligned.axes)]
            * UM_PER_MM
            / sigma_um[:, None]
        )

    usable, _ = aligned.usable
    old = [aligned.columns(one.effect, one.constants) * UM_PER_MM / sigma_um[:, None] for one in (*model, *pair)]
    good = usable & np.all([np.isfinite(one).all(axis=(1, 2)) for one in old], axis=0)
    new = [of(one) for one in (*model, *pair)]
    ends = np.cumsum([0, *(len(one) for one in programmes)])
    partings, steps = [], []
    for a, b in ((len(model), len(model) + 1), (len(model) + 1, len(model))):
        theta = (*model, *pair)[a].theta
        others = [*range(len(model)), b]
        held = np.concatenate([old[k][good] for k in others], axis=2).reshape(-1, sum(old[k].shape[2] for k in others))
        partings.append(_Parting((old[a][good] @ theta).ravel(), held))
        truth = new[a] @ theta
        imitation = np.concatenate([new[k] for k in others], axis=2)
        steps.append(_by_programme(truth, imitation, ends))
    before = np.sqrt(max(min(parting.square - _explained(parting) for parting in partings), 0.0))
    chosen: list[int] = []
    length = np.diff(ends)
    reached = np.array([parting.square - _explained(parting) for parting in partings])
    while length.min() <= rows - sum(length[k] for k in chosen):
        left = np.stack([parting.left(*step) for parting, step in zip(partings, steps, strict=True)])
        gain = np.min(left - reached[:, None], axis=0) / length
        gain[length > rows - sum(length[k] for k in chosen)] = -np.inf
        gain[chosen] /= 1.0 + np.array([chosen.count(k) for k in chosen])
        best = int(np.argmax(gain))
        chosen.append(best)
        for parting, (normal, score, square) in zip(partings, steps, strict=True):
            parting.add(normal[best], score[best], float(square[best]))
        reached = left[:, best]
    order = sorted(set(chosen))
    listed = [row for k in order for _ in range(chosen.count(k)) for row in _rows(programmes[k], fresh, ends[k], names)]
    numbered = tuple({"row": number, **row} for number, row in enumerate(listed, start=1))
    return MeasurementPlan(
        (pair[0].effect.id, pair[1].effect.id), numbered, float(np.sqrt(max(reached.min(), 0.0))), float(before)
    )


def _explained(parting: _Parting) -> float:
    ridge = RIDGE * np.diag(parting.normal) + 1e-12
    return float(parting.score @ solve(parting.normal, parting.score, ridge))


def _by_programme(
    truth: FloatArray, imitation: FloatArray, ends: np.ndarray[Any, Any]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Each programme's part of the normal equations: (K, p, p), (K, p), (K,)."""
    normal, score, square = [], [], []
    for begin, end in pairwise(ends):
        A = imitation[begin:end].reshape(-1, imitation.shape[2])
        y = truth[begin:end].ravel()
        normal.append(A.T @ A)
        score.append(A.T @ y)
        square.append(y @ y)
    return np.stack(normal), np.stack(score), np.array(square)


def _rows(one: Segment, fresh: Observations, begin: int, names: Sequence[str]) -> list[dict[str, Any]]:
    """What a person sets, row by row, in the columns of a recording where there are such."""
    return [
        plan_row(
            one.purpose,
            one.time_s[k],
            one.tip_M_mm[k],
            {name: fresh.quantities[name][begin + k] for name in names},
            fresh.direction[begin + k],
            np.abs(fresh.velocity_mm_per_s[begin + k]).max(),
        )
        for k in range(len(one))
    ]
