"""Scatter of each length at rest against its declared noise: one of them is wrong if they differ by a factor of 2.

A display with coarse digits scatters less than what it measures. So its smallest step counts as scatter, too, before a
noise is said to be declared too large.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from compd.live.acquisition.cross_checks.machine_view import MachineView, Remark
from compd.stated_noise import SCATTER_RATIO
from compd.units import UM_PER_MM

# Ratio at which the warning of SCATTER_RATIO ends: smaller, so that the warning does not flicker.
_NEAR = 1.8


class MeasuredScatter:
    """Compares the scatter with the noise."""

    def __init__(self) -> None:
        self._outside: set[int] = set()

    def look(self, view: MachineView) -> Iterator[Remark]:
        for i, wired in enumerate(view.wired[: view.memory.lengths]):
            scatter_um = float(view.memory.scatter_mm[i]) * UM_PER_MM
            declared_um = wired.noise * UM_PER_MM
            if not math.isfinite(scatter_um) or not math.isfinite(declared_um):
                self._outside.discard(i)
                continue
            ratio = _NEAR if i in self._outside else SCATTER_RATIO
            step_um = float(view.memory.step_mm[i]) * UM_PER_MM
            # standard deviation of a uniform distribution between two digits: 0.29 of their distance
            at_most_um = math.hypot(scatter_um, step_um / math.sqrt(12))
            if scatter_um > ratio * declared_um or at_most_um < declared_um / ratio:
                self._outside.add(i)
                yield Remark(i, f"scatters by {scatter_um:.2g} um at rest, declared: {declared_um:g} um (`noise_um`)")
            else:
                self._outside.discard(i)
