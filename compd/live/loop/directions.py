"""Direction of travel of each link, updated in every cycle so that thinned recordings keep it."""

from __future__ import annotations

from collections.abc import Sequence

from compd.gauge import Quality
from compd.live.loop.setpoint import Setpoint
from compd.live.loop.wiring import Wire
from compd.model.motion import REVERSAL_MM


class Directions:
    """Direction of travel of each link from its scale; a sink of the loop.

    A recording of a few rows per second would miss a link that goes out and comes back between two rows. A link has
    reversed when its scale has come back by more than REVERSAL_MM from the farthest point, as for the effects.
    """

    def __init__(self, scales: Sequence[Wire]) -> None:
        self._wires = tuple((wire.slot, wire.sign) for wire in scales)
        self._turning_mm: list[float | None] = [None] * len(self._wires)
        self._now = [0] * len(self._wires)

    @property
    def now(self) -> list[int]:
        """(n,) +1 or -1; 0 before the link has moved."""
        return list(self._now)

    def update(self, setpoint: Setpoint) -> None:
        """Take the readings of one cycle. Plain floats are faster here than arrays."""
        assert setpoint.inputs is not None
        readings = setpoint.inputs.snapshot.readings
        for link, (slot, sign) in enumerate(self._wires):
            value, _, quality, _ = readings[slot]
            if quality is not Quality.OK:
                continue
            here_mm, turning_mm = sign * value, self._turning_mm[link]
            if turning_mm is None:
                self._turning_mm[link] = here_mm
                continue
            since_mm, before = here_mm - turning_mm, self._now[link]
            if since_mm > REVERSAL_MM:
                self._now[link] = 1
            elif since_mm < -REVERSAL_MM:
                self._now[link] = -1
            # the farthest point moves on with the link, and stays while the link comes back by less than the threshold
            if self._now[link] != before or since_mm * before > 0:
                self._turning_mm[link] = here_mm
