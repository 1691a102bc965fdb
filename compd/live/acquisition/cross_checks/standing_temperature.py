"""A thermometer is stuck if it repeats its digits while all others of the machine grow warmer, or colder.

One in a body that changes slowly shows other digits, too: no two tenths of a degree in the time in which every other
one changes by kelvins. Where its digits are too coarse for that, it has changed by less than one of them, and so little
it is wrong.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from compd.arrays import FloatArray
from compd.live.acquisition.cross_checks.machine_view import Contradiction, MachineView

_MIN_OTHERS = 2


class StandingTemperature:
    """Remembers the values of all thermometers when each of them last changed its digits."""

    def __init__(self, changed_K: float) -> None:
        """`changed_K`: least change of all others, in the same direction."""
        self._changed_K = changed_K
        self._before: dict[int, tuple[float, FloatArray]] = {}  # number of its changes, and the values of all

    def look(self, view: MachineView) -> Iterator[Contradiction]:
        places = view.of_unit("degC")
        for i in places:
            changes = float(view.memory.changes[i])
            before = self._before.get(i)
            if before is None or before[0] != changes or not view.believed[i]:
                self._before[i] = changes, view.value.copy()
                continue
            others = [j for j in places if j != i and view.believed[j] and not np.isnan(before[1][j])]
            if len(others) < _MIN_OTHERS:
                continue
            risen_K = view.value[others] - before[1][others]
            if abs(risen_K.sum()) == np.abs(risen_K).sum() and np.abs(risen_K).min() >= self._changed_K:
                del self._before[i]
                yield Contradiction(
                    i, f"shows the same digits, while all others have changed by {np.abs(risen_K).min():.1f} K or more"
                )
