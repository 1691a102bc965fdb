"""The part of an error that one effect or description makes, beside the residual that is left with it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from compd.arrays import BoolArray, FloatArray, rms
from compd.comparison import Comparison
from compd.model import link_residuals
from compd.model.effects import FittedEffect
from compd.statistics import solve_least_squares
from compd.units import UM_PER_MM

# Ports of effects on each link: shown at the links if their lengths follow from the tip.
LINK_PORTS = {"scale", "link"}
# Least size of a drawn series, as a share of the largest.
MIN_SHARE = 0.1


@dataclass(frozen=True, eq=False)
class ErrorContribution:
    """The part of one effect in N rows of S series: measured coordinates, or links.

    series : their names, such as ``"x"`` or ``"link 1"``.  at_links : whether they are links.
    part, after : (N, S) what it does, and the residual that is left with it, in the recording's unit.
    used : (N,) rows that count.
    """

    series: tuple[str, ...]
    part: FloatArray
    after: FloatArray
    used: BoolArray
    at_links: bool

    @property
    def before(self) -> FloatArray:
        """(N, S) residual without it, with everything else found."""
        return np.asarray(self.after + self.part)

    def largest(self, most: int) -> list[int]:
        """The series with the largest parts, up to a number, in their order; negligible ones excluded."""
        sizes = np.array([rms(self.part[self.used, k]) for k in range(len(self.series))])
        order = [int(k) for k in np.argsort(-sizes)[:most] if sizes[k] > MIN_SHARE * sizes.max()]
        return sorted(order) or [0]


def error_contribution(
    comparison: Comparison, effects: Sequence[FittedEffect], described: Sequence[FittedEffect] = ()
) -> ErrorContribution:
    """The joint part of effects.

    comparison : whose model has the effects.  described : effects, among them these, that its model does not have: they
    are taken off the residual first.
    """
    aligned = comparison.aligned
    part_um = _moved(comparison, effects)
    after_um = comparison.residual_um - (_moved(comparison, described) if described else 0.0)
    used = comparison.used & np.isfinite(part_um).all(axis=1) & np.isfinite(after_um).all(axis=1)
    on_links = all(set(fitted.effect.ports) <= LINK_PORTS for fitted in effects)
    if on_links and comparison.link_residual_um is not None and aligned.rows.links == len(aligned.axes) == 3:
        link = aligned.sensitivity(["link"])["link"]
        labels = tuple(f"link {i + 1}" for i in range(aligned.rows.links))
        parts = (link_residuals(link, part_um[:, :3]), link_residuals(link, np.nan_to_num(after_um[:, :3])))
        return ErrorContribution(labels, *parts, used, at_links=True)
    return ErrorContribution(tuple(aligned.labels), part_um, after_um, used, at_links=aligned.of_links)


def _moved(comparison: Comparison, effects: Sequence[FittedEffect]) -> FloatArray:
    """(N, m) by how much effects move the prediction, um, without what is fitted along in any case.

    That is a constant or a motion of the instrument's frame, which takes a share of every effect.
    """
    aligned = comparison.aligned
    moved_um = np.zeros(comparison.residual_um.shape)
    for fitted in effects:
        moved_um += aligned.columns(fitted.effect, fitted.constants) @ fitted.theta * UM_PER_MM
    fixed = aligned.registration_columns
    if not fixed.shape[2]:
        return moved_um
    rows = comparison.used & np.isfinite(moved_um).all(axis=1) & np.isfinite(fixed).all(axis=(1, 2))
    taken = solve_least_squares(fixed[rows].reshape(-1, fixed.shape[2]), moved_um[rows].reshape(-1))
    return np.asarray(moved_um - fixed @ taken)
