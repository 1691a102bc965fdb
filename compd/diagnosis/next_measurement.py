"""The next measurement: the rows that tell two rivals apart best, by T-optimal experimental design."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TextIO

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.comparison.aligned_recording import AlignedRecording
from compd.comparison.least_squares import solve_ridge
from compd.diagnosis.measurement_programmes import Programme, ProgrammeLimits, observe_programmes, programmes
from compd.errors import Problem, RecordingError
from compd.model.effect import FittedEffect
from compd.model.effect_needs import needed_quantities
from compd.model.machine import MachineModel
from compd.model.observations import Observations
from compd.model.sensitivity import effect_sensitivity, sensitivities
from compd.recording.plan_file import plan_row, plan_text, write_plan_file
from compd.tables import Columns, data_frame, html_table
from compd.units import UM_PER_MM

if TYPE_CHECKING:
    import pandas as pd

# Ridge of the rival's refit, as a share of the diagonal of its normal equations: conditioning alone.
RIDGE = 1e-9


@dataclass(frozen=True, repr=False)
class MeasurementPlan:
    """Rows to measure, which tell two rival effects apart.

    Attributes
    ----------
    rivals : (str, str)
        Ids of the two effects.
    rows : tuple of dict
        One per row: each column of the plan's file and its value. `row`, `purpose`, `time_s`, the tip's place
        in {M} `tip_x_mm` ..., the directions in which the links come `approach_1` ..., `speed_mm_per_s`, and what is
        held: loads in N, temperatures in degC.
    separation : float
        By how much the nearer rival will differ from the other on the recording and these rows together, in standard
        deviations of the noise (root of the sum of squares over all rows).
    before : float
        The same on the recording alone.
    """

    rivals: tuple[str, str]
    rows: tuple[dict[str, Any], ...]
    separation: float
    before: float

    @property
    def summary(self) -> str:
        """What the rows are good for, in a sentence."""
        return (
            f"{self.rivals[0]} and {self.rivals[1]} differ by {self.before:.2g} times the noise on what was measured, "
            f"by {self.separation:.2g} times with these {len(self.rows)} rows."
        )

    def write_to(self, stream: TextIO) -> None:
        """Write the rows as CSV."""
        stream.write(plan_text(self.rows))

    def write(self, path: str | Path) -> None:
        """Write the rows as CSV, for a person at the machine or for `compd simulate --plan`.

        Parameters
        ----------
        path : str or Path
            Where to; an existing file is replaced.

        Raises
        ------
        RecordingError
            Where the file cannot be written.
        """
        write_plan_file(Path(path), self.rows)

    def to_dataframe(self) -> pd.DataFrame:
        """The rows, as a pandas data frame.

        Returns
        -------
        pandas.DataFrame
            One row per row to measure, with the columns of the file; nan where nothing is to be set.

        Raises
        ------
        CompdError
            Where pandas is not installed.
        """
        return data_frame(self._columns())

    def _repr_html_(self) -> str:
        return html_table(self.summary, self._columns())

    def __repr__(self) -> str:
        return f"<MeasurementPlan: {self.summary}>"

    def _columns(self) -> Columns:
        names = dict.fromkeys(name for row in self.rows for name in row)
        return {name: [row.get(name, np.nan) for row in self.rows] for name in names}


class _ProgrammeSums(NamedTuple):
    """What each of K programmes adds to a rival's refit: normal (K, p, p), score (K, p), square (K,)."""

    normal: FloatArray
    score: FloatArray
    square: FloatArray


class _RivalRefit:
    """Least squares of one effect's prediction by its rival's columns, on rows that grow by programmes.

    With y what the effect predicts and A the columns of the rival and of the model, A^T A, A^T y and y^T y are kept.
    """

    def __init__(self, predicted: FloatArray, rival_columns: FloatArray) -> None:
        """predicted : (n,).  rival_columns : (n, p)."""
        self._normal = rival_columns.T @ rival_columns
        self._score = rival_columns.T @ predicted
        self._square = float(predicted @ predicted)

    def discrepancy(self) -> float:
        """Sum of squares that the rival cannot imitate."""
        theta = solve_ridge(self._normal, self._score, self._ridge)
        return self._square - float(self._score @ theta)

    def discrepancies_with(self, sums: _ProgrammeSums) -> FloatArray:
        """(K,) the same after adding each of K programmes."""
        normal = self._normal + sums.normal
        score = self._score + sums.score
        theta = solve_ridge(normal, score, np.broadcast_to(self._ridge, score.shape))
        return np.asarray(self._square + sums.square - (score * theta).sum(axis=-1))

    def add(self, sums: _ProgrammeSums, k: int) -> None:
        """Add the rows of programme k."""
        self._normal = self._normal + sums.normal[k]
        self._score = self._score + sums.score[k]
        self._square = self._square + float(sums.square[k])

    @property
    def _ridge(self) -> FloatArray:
        return np.asarray(RIDGE * np.diag(self._normal) + 1e-12)


def plan_measurement(
    aligned: AlignedRecording,
    model: Sequence[FittedEffect],
    pair: tuple[FittedEffect, FittedEffect],
    sigma_um: FloatArray,
    limits: ProgrammeLimits,
    rows: int,
) -> MeasurementPlan:
    """The rows on which two fitted rivals differ most, however the other one is refitted.

    The criterion is T-optimality (Atkinson and Fedorov, Biometrika 62 (1975) 57): with the prediction of rival 1 as
    the truth, the sum of squares that rival 2 leaves with its best parameters, in variances of the noise, ::

        T_12 = min_theta  sum_i |eta_1(x_i) - A_2(x_i) theta|^2 / sigma^2

    and likewise T_21. The parameters of the model's effects are refitted along, and the recording's rows count. Where
    a D-optimal design would make the parameters of one effect most precise, this one makes the wrong effect fail.
    Programmes are added one at a time (the sequential construction of optimal designs: Fedorov, Theory of Optimal
    Experiments (1972)), each the one that adds most per row to the smaller of the two; what a programme that was
    chosen n times already adds counts 1 / (n + 1) of it, so that different programmes are taken.

    model : the model's own effects.  pair : the rivals, fitted on the recording.  sigma_um : (m,) noise.
    rows : how many may be measured at most.

    Raises RecordingError for an external model, and where a place within the limits cannot be reached.

    Example::

        plan = plan_measurement(aligned, (), (spring, contact), sigma_um, recorded_limits(aligned), rows=30)
        plan.before, plan.separation  # by how many standard deviations the two differ, before and after
    """
    model_of_machine = require_kinematics(aligned)
    names = list(
        dict.fromkeys(name for effect in pair for name in needed_quantities(effect.effect, aligned.rows.links))
    )
    possible = [programme for programme in programmes(aligned, limits, names) if len(programme) <= rows]
    observations = observe_programmes(model_of_machine, aligned.rows.constants, possible, aligned)
    lengths = np.array([len(programme) for programme in possible])
    ends = np.cumsum([0, *lengths])
    refits, sums = _rival_refits(aligned, model, pair, sigma_um, observations, ends)
    before = np.sqrt(max(min(refit.discrepancy() for refit in refits), 0.0))
    chosen, discrepancy = _choose(refits, sums, lengths, rows)
    planned = [
        row
        for k in sorted(set(chosen))
        for _ in range(chosen.count(k))
        for row in _rows_to_set(possible[k], observations, ends[k], names)
    ]
    return MeasurementPlan(
        rivals=(pair[0].effect.id, pair[1].effect.id),
        rows=tuple({"row": number, **row} for number, row in enumerate(planned, start=1)),
        separation=float(np.sqrt(max(discrepancy, 0.0))),
        before=float(before),
    )


def require_kinematics(aligned: AlignedRecording) -> MachineModel:
    """The machine's model. Raises RecordingError for an external one, in which no place can be reached."""
    if aligned.model is None:
        raise RecordingError(
            Problem(
                where=str(aligned.recording.path),
                what="of an external model's machine no measurement can be planned",
                next_step="write a machine configuration",
            )
        )
    return aligned.model


def _rival_refits(
    aligned: AlignedRecording,
    model: Sequence[FittedEffect],
    pair: tuple[FittedEffect, FittedEffect],
    sigma_um: FloatArray,
    observations: Observations,
    ends: IntArray,
) -> tuple[list[_RivalRefit], list[_ProgrammeSums]]:
    """Each rival refitted to the other on the recording, and what each programme adds to that.

    observations : rows of all programmes.  ends : (K + 1,) of each programme among them.
    """
    effects = (*model, *pair)
    recorded = [aligned.columns(effect.effect, effect.constants) * UM_PER_MM / sigma_um[:, None] for effect in effects]
    usable = aligned.usable.mask
    known = usable & np.all([np.isfinite(values).all(axis=(1, 2)) for values in recorded], axis=0)
    new = _columns_on(aligned, observations, effects, sigma_um)
    refits, sums = [], []
    for truth, rival in ((len(model), len(model) + 1), (len(model) + 1, len(model))):
        theta = effects[truth].theta
        fitted = [*range(len(model)), rival]
        rival_columns = np.concatenate([recorded[k][known] for k in fitted], axis=2)
        refits.append(
            _RivalRefit((recorded[truth][known] @ theta).ravel(), rival_columns.reshape(-1, rival_columns.shape[2]))
        )
        sums.append(_programme_sums(new[truth] @ theta, np.concatenate([new[k] for k in fitted], axis=2), ends))
    return refits, sums


def _columns_on(
    aligned: AlignedRecording, observations: Observations, effects: Sequence[FittedEffect], sigma_um: FloatArray
) -> list[FloatArray]:
    """(R, m, P) of each effect: whitened columns on rows that were not measured yet."""
    assert aligned.model is not None
    by_port = sensitivities(aligned.model, observations, {port for effect in effects for port in effect.effect.ports})
    whitened = []
    for effect in effects:
        basis, _ = effect.effect.basis(observations, effect.constants, None)
        predicted = effect_sensitivity(effect.effect, observations, basis, by_port)
        measured = (predicted.link_length if aligned.of_links else predicted.tip)[:, list(aligned.axes)]
        whitened.append(measured * UM_PER_MM / sigma_um[:, None])
    return whitened


def _programme_sums(predicted: FloatArray, rival_columns: FloatArray, ends: IntArray) -> _ProgrammeSums:
    """Sums over the rows of each programme of predicted (R, m) and rival_columns (R, m, p)."""
    normal, score, square = [], [], []
    for begin, end in pairwise(ends):
        A = rival_columns[begin:end].reshape(-1, rival_columns.shape[2])
        y = predicted[begin:end].ravel()
        normal.append(A.T @ A)
        score.append(A.T @ y)
        square.append(y @ y)
    return _ProgrammeSums(np.stack(normal), np.stack(score), np.array(square))


def _choose(
    refits: Sequence[_RivalRefit], sums: Sequence[_ProgrammeSums], lengths: IntArray, rows: int
) -> tuple[list[int], float]:
    """Programmes in the order in which they are chosen, and the smaller discrepancy with all of them."""
    chosen: list[int] = []
    reached = np.array([refit.discrepancy() for refit in refits])
    while lengths.min() <= (rows_left := rows - sum(lengths[k] for k in chosen)):
        discrepancies = np.stack([refit.discrepancies_with(parts) for refit, parts in zip(refits, sums, strict=True)])
        gain_per_row = np.min(discrepancies - reached[:, None], axis=0) / lengths
        gain_per_row[lengths > rows_left] = -np.inf
        gain_per_row[chosen] /= 1.0 + np.array([chosen.count(k) for k in chosen])
        best = int(np.argmax(gain_per_row))
        chosen.append(best)
        for refit, parts in zip(refits, sums, strict=True):
            refit.add(parts, best)
        reached = discrepancies[:, best]
    return chosen, float(reached.min())


def _rows_to_set(
    programme: Programme, observations: Observations, begin: int, names: Sequence[str]
) -> list[dict[str, Any]]:
    """What a person sets in each row of a programme, by column of the plan's file.

    begin : the programme's first row among the observations.  names : quantities to be set.
    """
    return [
        plan_row(
            programme.purpose,
            programme.time_s[k],
            programme.tip_M_mm[k],
            {name: observations.quantities[name][begin + k] for name in names},
            observations.direction[begin + k],
            np.abs(observations.velocity_mm_per_s[begin + k]).max(),
        )
        for k in range(len(programme))
    ]
