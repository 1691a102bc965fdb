"""How far apart two measurements of the same thing are: the noise floor, and rows that are beyond all noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from scipy.stats import f

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.comparison.outliers import find_replicates
from compd.comparison.robust import robust_sigma

# A declared uncertainty is taken to be right within 5 %, which counts as so many measurements (GUM, G.4.2:
# 1 / (2 x 0.05^2)). Repeats that contradict it overrule it: a hundred of them do where it is wrong by a fifth.
DECLARED_DOF = 200.0
CONTRADICTION = 0.001

Source = Literal["repeats", "declared", "estimate"]


@dataclass(frozen=True)
class NoiseFloor:
    """Standard deviation of a residual that holds nothing but noise: the reference's and the gauges'.

    by_axis_um : (m,).  source : where it is from.  how : the same in a sentence.
    dof : how many independent numbers it rests on; inf for a declaration that nothing tests.
    """

    by_axis_um: FloatArray
    source: Source
    how: str
    dof: float

    @property
    def um(self) -> float:
        """Per coordinate, over all axes."""
        return float(np.sqrt(np.mean(self.by_axis_um**2)))


class Scatter(NamedTuple):
    """Pooled scatter within visits: by_axis_um (m,); dof of each axis; visits left out, a row in them being gross."""

    by_axis_um: FloatArray
    dof: int
    gross_visits: int


def repeat_scatter(residual_um: FloatArray, use: BoolArray, visit: IntArray | None) -> Scatter | None:
    """Pure error: scatter of residual_um (N, m) within visits, pooled; None where no visit of `use` is repeated.

    Of the residual, not of the reference: what the model follows between two repeats does not count.
    """
    repeats = None if visit is None else find_replicates(residual_um, use, visit)
    if repeats is None:
        return None
    gross = np.unique(repeats.visit[repeats.outlier])
    kept = ~np.isin(repeats.visit, gross)
    if not kept.any():
        return None
    share = (repeats.size[kept] - 1.0) / repeats.size[kept]  # of a degree of freedom, each row's
    squares = (repeats.deviation_um[kept] ** 2 * share[:, None]).sum(axis=0)
    return Scatter(np.sqrt(squares / share.sum()), round(float(share.sum())), len(gross))


def noise_floor(
    residual_um: FloatArray,
    use: BoolArray,
    visit: IntArray | None,
    declared_um: FloatArray,
    gauges_um: FloatArray,
    orders: tuple[FloatArray, ...],
) -> NoiseFloor:
    """From repeats; else from what is declared; else an estimate.

    residual_um : (N, m), of which `use` (N,) counts.  declared_um : (m,) the reference's standard uncertainty, nan
    where nobody gave it.  gauges_um : (m,) the gauges' noise at the tip, nan where unknown (then left out).
    orders : what to sort the rows by for an estimate, (N,) each.
    """
    expected_um = np.sqrt(declared_um**2 + np.nan_to_num(gauges_um) ** 2)
    known = bool(np.isfinite(declared_um).all())
    scatter = repeat_scatter(residual_um, use, visit)
    if scatter is not None and (scatter.by_axis_um > 0).all():
        return _from_repeats(scatter, expected_um if known else None)
    if known:
        gauges = "" if np.isnan(gauges_um).any() else f" with the gauges' {_rms(gauges_um):.3g} um at the tip"
        how = f"declared: the reference's {_rms(declared_um):.3g} um{gauges}; no visit is repeated, so nothing tests it"
        return NoiseFloor(expected_um, "declared", how, float("inf"))
    return _estimate(residual_um[use], tuple(order[use] for order in orders))


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _from_repeats(scatter: Scatter, expected_um: FloatArray | None) -> NoiseFloor:
    """The repeats; a declaration that they do not contradict counts along, as measurements of its own."""
    axes = len(scatter.by_axis_um)
    found = f"repeats of one visit scatter by {_rms(scatter.by_axis_um):.3g} um ({scatter.dof} repeats)"
    if scatter.gross_visits:
        found += f", {scatter.gross_visits} visits with a gross row left out"
    if expected_um is None:
        return NoiseFloor(scatter.by_axis_um, "repeats", found, float(scatter.dof * axes))
    declared = f"declared noise of {_rms(expected_um):.3g} um"
    ratio = float(np.mean((scatter.by_axis_um / expected_um) ** 2))
    chance = float(f.cdf(ratio, scatter.dof * axes, DECLARED_DOF * axes))
    if min(chance, 1 - chance) < CONTRADICTION / 2:
        return NoiseFloor(
            scatter.by_axis_um, "repeats", f"{found} and contradict the {declared}", float(scatter.dof * axes)
        )
    dof = scatter.dof + DECLARED_DOF
    pooled = np.sqrt((scatter.dof * scatter.by_axis_um**2 + DECLARED_DOF * expected_um**2) / dof)
    return NoiseFloor(pooled, "repeats", f"{found}, which agrees with the {declared}; both count", dof * axes)


def _estimate(residual_um: FloatArray, orders: tuple[FloatArray, ...]) -> NoiseFloor:
    """Differences of rows that are neighbours in time, place or temperature: in the order in which they differ least.

    (von Neumann, Ann. Math. Stat. 12 (1941) 367.) What changes from row to row in every order counts as noise.
    """
    smallest = np.full(residual_um.shape[1], np.inf)
    for order in orders:
        steps_um = np.diff(residual_um[np.argsort(order, kind="stable")], axis=0) / np.sqrt(2.0)
        if len(steps_um):
            smallest = np.minimum(smallest, robust_sigma(steps_um))
    how = "an estimate, from differences of neighbouring rows: no visit is repeated and no uncertainty is declared"
    return NoiseFloor(smallest, "estimate", how, float(len(residual_um) * residual_um.shape[1]) / 1.5)
