"""A gauge is stuck if it repeats the same digits while others scatter.

It can be told of gauges whose noise is not below their resolution: of these each new sample differs from the one before
with a probability of 0.62 or more, wherever the value stands between two digits. A device that samples less often than
it is asked gives each sample several times; so the time without a change is compared with the usual one between
changes.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from compd.live.acquisition.cross_checks.machine_view import Contradiction, MachineView

# Equal readings that show a stuck gauge, also as multiples of the usual time between changes. Where a sample repeats
# the one before with a probability p, changes are 1 / (1 - p) samples apart, and a streak of 40 times as many comes
# with less than exp(-40) = 4e-18, whatever p is.
_STREAK = 40.0
# A gauge scatters if its last change is at most this many of its usual times ago.
_SCATTERING = 5.0
_MIN_CHANGES = 100


class RepeatedDigits:
    """Looks at how often each gauge has given the same digits."""

    def look(self, view: MachineView) -> Iterator[Contradiction]:
        memory = view.memory
        noise = np.array([wired.noise for wired in view.wired])
        n = len(view.wired)
        changes = memory.changes[:n]
        usual_s = (memory.last_change_s[:n] - memory.first_change_s[:n]) / np.maximum(changes - 1.0, 1.0)
        since_s = memory.shown_s[:n] - memory.last_change_s[:n]
        able = view.believed & (changes >= _MIN_CHANGES) & (noise >= memory.step_mm[:n])
        scatter = able & (since_s <= _SCATTERING * usual_s)
        if not scatter.any():
            return
        stuck = able & (since_s > _STREAK * usual_s) & (memory.repeats[:n] > _STREAK)
        for i in np.flatnonzero(stuck).tolist():
            repeats = int(memory.repeats[i])
            yield Contradiction(i, f"stuck: the same digits {repeats} times, while {scatter.sum()} others scatter")
