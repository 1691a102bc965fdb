"""Periods of an effect that are not known in advance: the few that a residual suggests, beside the effect's grid.

At a wrong period an effect with a period (`Constant.period_of`) explains nothing, and a screw of 1.37 mm pitch is on no
grid of round numbers. So the residual is pulled back to the places where the effect acts, the links' scales for
instance, by the pseudoinverse of the prediction's derivatives there. A periodogram of it against the quantity shows the
strongest periods, and the effect's own columns decide between each of them and its double: a peak may be the second
harmonic.

Example::

    found = promising_constants(library["scale_cyclic"], aligned, comparison.residual_um, comparison.used)
    found.constants           # [{"p": 1.370}, {"p": 2.740}, ...], the one that explains most first
    found.searched_parameters # 9: the best of 5000 periods fits noise about as nine parameters do
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from compd.arrays import BoolArray, FloatArray
from compd.comparison.alignment.aligned_recording import AlignedRecording
from compd.model.effects import Constant, ConstantValues, Effect, evaluate_basis, port_size
from compd.model.formula import column_values
from compd.statistics import PeriodLimits, shortest_period, solve_least_squares, strongest_periods
from compd.units import UM_PER_MM


class PromisingConstants(NamedTuple):
    """What a search for periods found.

    constants : values of the effect's nonlinear constants, the one that explains most first; none for an effect without
        a period, and where the rows resolve none.
    independent : among how many periods that do not resemble one another.
    """

    constants: list[dict[str, float]]
    independent: int

    @property
    def searched_parameters(self) -> int:
        """For how many fitted parameters the search counts: the best of M fits noise about as log M parameters do."""
        return round(math.log(max(self.independent, 1)))


def promising_constants(
    effect: Effect, aligned: AlignedRecording, residual_um: FloatArray, rows: BoolArray
) -> PromisingConstants:
    """The nonlinear constants, with a searched period, at which an effect explains most of a residual.

    The machine's setting of a period, where there is one, is in the effect's own grid: what is found here may differ.

    residual_um : (N, m) to explain.  rows : (N,) those that count.
    """
    criteria = aligned.criteria.periods
    constant = next((constant for constant in effect.constants if constant.period_of), None)
    if constant is None:
        return PromisingConstants([], 0)
    others = [
        {name: value for name, value in constants.items() if name != constant.name}
        for constants in effect.constant_grid(aligned.rows)
    ]
    others = [dict(items) for items in dict.fromkeys(tuple(other.items()) for other in others)]
    quantity, series, usable = _at_places(effect, constant, others[0], aligned, residual_um, rows)
    if usable.sum() < criteria.min_rows:
        return PromisingConstants([], 0)
    limits = PeriodLimits(constant.low, constant.high, criteria.min_turns, criteria.max_turns)
    search = strongest_periods(quantity, series, limits, criteria.peaks, criteria)
    periods = [period for peak in search.periods for period in (peak, 2 * peak) if period <= constant.high]
    trials = [{**other, constant.name: period} for period in periods for other in others]
    trials.sort(key=lambda trial: -_explained_um2(effect, trial, aligned, residual_um, usable))
    return PromisingConstants(trials[: criteria.trials], search.independent)


def told_periods(effect: Effect, constant: Constant, aligned: AlignedRecording) -> tuple[float, float]:
    """The shortest period that is told from its images, and the longest that is seen to repeat.

    At places on an even grid a period below twice its distance makes what a longer one makes. The rows cover a turn of
    the longest, to a quarter of one: over less a sine of any period and phase is a slope and a bend, and would take the
    place of what makes these.
    """
    quantity = column_values(aligned.rows, constant.period_of, effect.ports[0])
    known = quantity[np.isfinite(quantity).all(axis=1)]
    return shortest_period(known, constant.low, aligned.criteria.periods), _longest_period(effect, constant, aligned)


def _longest_period(effect: Effect, constant: Constant, aligned: AlignedRecording) -> float:
    return min(constant.high, _span(effect, constant, aligned) / (1 - aligned.criteria.periods.neighbour_turns))


def neighbouring_periods(
    effect: Effect, constant: Constant, aligned: AlignedRecording, period: float
) -> tuple[float, float]:
    """The periods a quarter of a turn away over the range of the quantity: there a period fits half as well at best.

    None is beyond what is plausible, or too long to be seen to repeat.
    """
    turns = _span(effect, constant, aligned) / period
    apart = aligned.criteria.periods.neighbour_turns
    share = min(apart / max(turns, apart), 0.5)
    longest = max(_longest_period(effect, constant, aligned), period)
    return max(period / (1 + share), min(constant.low, period)), min(period / (1 - share), longest)


def _span(effect: Effect, constant: Constant, aligned: AlignedRecording) -> float:
    """How far the quantity of a period ranges."""
    quantity = column_values(aligned.rows, constant.period_of, effect.ports[0])
    return float(np.nanmax(quantity) - np.nanmin(quantity))


def _at_places(
    effect: Effect,
    constant: Constant,
    others: ConstantValues,
    aligned: AlignedRecording,
    residual_um: FloatArray,
    rows: BoolArray,
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """The quantity (R, S) or (R, 1), the residual in um (R, S) at the S places where the effect acts, and the R rows.

    Of an effect with several ports, at the first.
    """
    port = effect.ports[0]
    size = port_size(port, aligned.rows)
    basis, _ = evaluate_basis(effect, aligned.rows, {**others, constant.name: constant.high}, None)
    acts = (np.nan_to_num(basis[:, :size]) != 0).any(axis=(0, 2))
    one_each = np.broadcast_to(np.eye(basis.shape[1], size), (len(rows), basis.shape[1], size))
    derivatives = aligned.propagated(effect, one_each)[:, :, acts]
    quantity = column_values(aligned.rows, constant.period_of, port)
    if quantity.shape[1] > 1:
        quantity = np.repeat(quantity, size // quantity.shape[1], axis=1)[:, acts]
    usable = (
        rows
        & np.isfinite(residual_um).all(axis=1)
        & np.isfinite(quantity).all(axis=1)
        & np.isfinite(derivatives).all(axis=(1, 2))
    )
    series = (np.linalg.pinv(derivatives[usable]) @ residual_um[usable, :, None])[:, :, 0]
    return quantity[usable], series, usable


def _explained_um2(
    effect: Effect, constants: ConstantValues, aligned: AlignedRecording, residual_um: FloatArray, rows: BoolArray
) -> float:
    """Sum of squares of the residual that the effect explains beside constants and the instrument's frame."""
    own_um = aligned.columns(effect, constants)[rows] * UM_PER_MM
    level = np.broadcast_to(np.eye(residual_um.shape[1]), (len(own_um), *[residual_um.shape[1]] * 2))
    A = np.concatenate([own_um, level, aligned.registration_columns[rows]], axis=2)
    A = A.reshape(residual_um[rows].size, -1)
    y = residual_um[rows].ravel()
    return float(y @ y - np.sum((y - A @ solve_least_squares(A, y)) ** 2))
