"""Planning a measurement: what effects predict on recorded and on possible rows, and the rows on which they differ."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from compd.arrays import BoolArray, FloatArray
from compd.comparison import AlignedRecording
from compd.model.effects import ConstantValues, Effect, FittedEffect
from compd.planning.measurement_plan import MeasurementPlan
from compd.planning.planning_criteria import PlanningCriteria
from compd.planning.programme_rows import ProgrammeRows, at_rows
from compd.planning.t_optimal import Predictions, RivalRefit, choose_programmes
from compd.statistics import solve_least_squares
from compd.units import UM_PER_MM


class WhitenedColumns(NamedTuple):
    """Columns in standard deviations of the noise, on the recording's rows (N, m, P) and on possible ones (R, m, P)."""

    recorded: FloatArray
    possible: FloatArray


class Contender(NamedTuple):
    """An effect with its numbers, or whatever else may be the cause of an error. theta : (P,)."""

    name: str
    columns: WhitenedColumns
    theta: FloatArray


# A cause as the truth, and what might pass for it; None: nothing but what is fitted along.
Contest = tuple[Contender, Contender | None]


class MeasurementPlanner:
    """Plans for one recording and one set of possible rows.

    Example::

        planner = MeasurementPlanner(aligned, (), sigma_um, possible)
        spring, contact = planner.contender(fitted_spring), planner.contender(fitted_contact)
        plan = planner.plan([(spring, contact), (contact, spring)], 30)
    """

    def __init__(
        self,
        aligned: AlignedRecording,
        model: Sequence[FittedEffect],
        sigma_um: FloatArray,
        possible: ProgrammeRows,
        *,
        with_nuisance: bool = True,
        criteria: PlanningCriteria = PlanningCriteria(),
    ) -> None:
        """model : effects that are fitted along.  sigma_um : (m,) noise.

        with_nuisance : whether the instrument's frame and the constants are fitted along as well.
        """
        self._aligned, self._sigma_um, self._possible, self._criteria = aligned, sigma_um, possible, criteria
        self._planned = at_rows(aligned, possible.observations)
        self._along = [self.contender(effect).columns for effect in model]
        if with_nuisance:
            # one frame for all rows
            nuisance_mm = at_rows(aligned, aligned.rows.extended_by(possible.observations)).registration_columns
            self._along.append(self._whitened(*np.split(nuisance_mm, [len(aligned.rows)])))

    def contender(self, fitted: FittedEffect) -> Contender:
        """A fitted effect."""
        columns = (rows.columns(fitted.effect, fitted.constants) for rows in (self._aligned, self._planned))
        return Contender(fitted.effect.id, self._whitened(*columns), fitted.theta)

    def constant(self, by_axis_um: FloatArray) -> Contender:
        """A constant (m,) of the measured coordinates."""
        counts = len(self._aligned.rows), len(self._possible.observations)
        axes = np.eye(len(by_axis_um)) / UM_PER_MM
        columns = (np.broadcast_to(axes, (count, *axes.shape)) for count in counts)
        return Contender("a constant", self._whitened(*columns), by_axis_um)

    def imitation(self, truth: Contender, effect: Effect, constants: ConstantValues | None = None) -> Contender:
        """An effect with the numbers by which it imitates `truth` best on the recording.

        constants : its nonlinear constants; None for those of its grid by which it does best.
        """
        grid = effect.constant_grid(self._aligned.rows) if constants is None else [constants]
        along = [part.recorded for part in self._along]
        trials = []
        for trial in grid:
            columns = self._aligned.columns(effect, trial) * UM_PER_MM / self._sigma_um[:, None]
            rows = self._known([truth.columns.recorded, columns, *along])
            A = np.concatenate([part[rows] for part in (columns, *along)], axis=2)
            A = A.reshape(-1, A.shape[2])
            y = (truth.columns.recorded[rows] @ truth.theta).ravel()
            theta = solve_least_squares(A, y)
            left = float(((y - A @ theta) ** 2).sum())
            trials.append((left, FittedEffect(effect, theta[: columns.shape[2]], trial)))
        return self.contender(min(trials, key=lambda pair: pair[0])[1])

    def plan(self, contests: Sequence[Contest], most_rows: int, separated_by: str = "") -> MeasurementPlan:
        """At most so many rows, on which the truth of each contest differs most from its rival.

        A programme with a row on which something cannot be computed is not taken.
        separated_by : what would tell them apart, in words, should the rows not.
        """
        refits, known = zip(*(self._refit(contest) for contest in contests), strict=True)
        lengths = np.where(np.all(known, axis=0), self._possible.lengths, most_rows + 1)
        choice = choose_programmes(refits, lengths, most_rows)
        programmes = sorted(choice.programmes)
        rows = [row for k in programmes for row in self._possible.rows_of(k)]
        names = dict.fromkeys(contender.name for contest in contests for contender in contest if contender is not None)
        return MeasurementPlan(
            rivals=tuple(names),
            rows=tuple({"row": number, **row} for number, row in enumerate(rows, start=1)),
            separation=float(np.sqrt(max(choice.after, 0.0))),
            before=float(np.sqrt(max(choice.before, 0.0))),
            separated_by=separated_by,
            difference_um=self._difference_um(contests[0], programmes),
            criteria=self._criteria,
        )

    def _difference_um(self, contest: Contest, programmes: Sequence[int]) -> tuple[tuple[float, ...], ...]:
        """Of what the two sides predict on each row of the programmes, as they are fitted."""
        truth, rival = contest
        if rival is None or not programmes:
            return ()
        ends = self._possible.ends
        rows = np.concatenate([np.arange(ends[k], ends[k + 1]) for k in programmes])
        sides = [side.columns.possible[rows] @ side.theta for side in (truth, rival)]
        return tuple(tuple(row) for row in ((sides[0] - sides[1]) * self._sigma_um).tolist())

    def _refit(self, contest: Contest) -> tuple[RivalRefit, BoolArray]:
        """The rival's refit, and (K,) the programmes on which it can be computed."""
        truth, rival = contest
        fitted = self._along if rival is None else [rival.columns, *self._along]
        rows = self._known([part.recorded for part in (truth.columns, *fitted)])
        recorded = np.concatenate([part.recorded[rows] for part in fitted], axis=2)
        possible = np.concatenate([part.possible for part in fitted], axis=2)
        effect = truth.columns.possible @ truth.theta
        known = np.isfinite(possible).all(axis=(1, 2)) & np.isfinite(effect).all(axis=1)
        refit = RivalRefit(
            Predictions(truth.columns.recorded[rows] @ truth.theta, recorded),
            Predictions(np.where(known[:, None], effect, 0.0), np.where(known[:, None, None], possible, 0.0)),
            self._possible.ends,
        )
        return refit, np.logical_and.reduceat(known, self._possible.ends[:-1])

    def _known(self, columns: Sequence[FloatArray]) -> BoolArray:
        """(N,) usable rows of the recording on which all columns (N, m, P) are known."""
        finite = [np.isfinite(values).all(axis=(1, 2)) for values in columns]
        return np.asarray(self._aligned.usable.mask & np.all(finite, axis=0))

    def _whitened(self, recorded_mm: FloatArray, possible_mm: FloatArray) -> WhitenedColumns:
        return WhitenedColumns(*(values * UM_PER_MM / self._sigma_um[:, None] for values in (recorded_mm, possible_mm)))
