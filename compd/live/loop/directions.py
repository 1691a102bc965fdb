"""Which way each link moved last: seen in every cycle, told in the few that are recorded."""

from __future__ import annotations

from collections.abc import Sequence

from compd.gauge import Quality
from compd.live.loop.setpoint import Setpoint
from compd.live.loop.wiring import Wire
from compd.model.motion import REVERSAL_MM


class Directions:
    """An outlet of the loop: a recording at a few Hz would miss a link that went out and came back between two rows.

    now : +1 or -1 for each link, 0 before it has moved. A link has turned round when it has come back by more than
    REVERSAL_MM, as for the effects.
    """

    def __init__(self, scales: Sequence[Wire]) -> None:
        self._wires = tuple((wire.slot, wire.sign) for wire in scales)
        self._turning_mm: list[float | None] = [None] * len(self._wires)
        self._now = [0] * len(self._wires)

    @property
    def now(self) -> list[int]:
        """(n,)."""
        return list(self._now)

    def saw(self, setpoint: Setpoint) -> None:
        """One cycle; plain numbers, since this is within the loop's time."""
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
            # onwards the farthest point goes with the link; while it comes back by less, it stays
            if self._now[link] != before or since_mm * before > 0:
                self._turning_mm[link] = here_mm
