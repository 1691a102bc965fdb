"""A gauge that repeats the very same digits while others scatter is stuck.

It can be told of gauges whose noise is larger than their resolution: of these every second reading or more differs from
the one before, so that many equal ones in a row do not come by chance.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from compd.live.acquisition.votes.machine_view import Contradiction, MachineView

# Below 1e-12 per reading a vote by chance comes once in 300 years, of 30 channels that are read 100 times a second.
_CHANCE = 1e-12
# Share of repeats of a gauge whose noise is as large as its resolution, wherever it stands between two digits: at most
# 0.38; with a margin for a noise that is declared a little too large.
_LARGEST_SHARE = 0.6
# A share that is measured lower is not relied on.
_SMALLEST_SHARE = 0.3
_FEWEST_CHANGES = 100
# A gauge scatters while it has not repeated its digits for more polls than this.
_SCATTERING = 5


class RepeatedDigits:
    """Looks at how often each gauge has given the same digits."""

    def look(self, view: MachineView) -> Iterator[Contradiction]:
        memory = view.memory
        noise_mm = np.array([wired.noise_um for wired in view.wired]) * 1e-3
        n = len(view.wired)
        same = memory.same[:n]
        share = same / np.maximum(same + memory.changes[:n], 1.0)
        able = view.believed & (memory.changes[:n] >= _FEWEST_CHANGES) & (share <= _LARGEST_SHARE)
        able &= noise_mm >= memory.step_mm[:n]
        scatter = able & (memory.repeats[:n] <= _SCATTERING)
        if not scatter.any():
            return
        for i in np.flatnonzero(able & ~scatter).tolist():
            repeats = int(memory.repeats[i])
            if repeats * math.log(max(float(share[i]), _SMALLEST_SHARE)) < math.log(_CHANCE):
                yield Contradiction(i, f"stuck: the same digits {repeats} times, while {scatter.sum()} others scatter")
