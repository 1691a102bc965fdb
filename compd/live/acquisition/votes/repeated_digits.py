"""A gauge that repeats the very same digits while others scatter is stuck.

It can be told of gauges whose noise is not below their resolution: of these each new sample differs from the one before
with a probability of 0.62 or more, wherever the value stands between two digits. A device that samples less often than
it is asked gives each sample several times, so that streaks are counted in mean runs of equal readings.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from compd.live.acquisition.votes.machine_view import Contradiction, MachineView

# Where each sample repeats the one before with a probability p, the mean run is 1 / (1 - p) samples, and a streak of k
# samples comes with p ** k: one of 40 mean runs with less than exp(-40) = 4e-18, whatever p is.
_STREAK_IN_MEAN_RUNS = 40.0
# A gauge scatters while its streak is no longer than this.
_SCATTERING_IN_MEAN_RUNS = 5.0
_FEWEST_CHANGES = 100


class RepeatedDigits:
    """Looks at how often each gauge has given the same digits."""

    def look(self, view: MachineView) -> Iterator[Contradiction]:
        memory = view.memory
        noise_mm = np.array([wired.noise_um for wired in view.wired]) * 1e-3
        n = len(view.wired)
        changes = memory.changes[:n]
        mean_run = (memory.same[:n] + changes) / np.maximum(changes, 1.0)
        able = view.believed & (changes >= _FEWEST_CHANGES) & (noise_mm >= memory.step_mm[:n])
        scatter = able & (memory.repeats[:n] <= _SCATTERING_IN_MEAN_RUNS * mean_run)
        if not scatter.any():
            return
        for i in np.flatnonzero(able & (memory.repeats[:n] > _STREAK_IN_MEAN_RUNS * mean_run)).tolist():
            repeats = int(memory.repeats[i])
            yield Contradiction(i, f"stuck: the same digits {repeats} times, while {scatter.sum()} others scatter")
