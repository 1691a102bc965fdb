"""Direction of travel of each link, updated in every cycle so that thinned recordings keep it."""

from __future__ import annotations

from collections.abc import Sequence

from compd.gauge import Quality
from compd.live.loop.setpoint import Setpoint
from compd.live.machine import Wire
from compd.travel_direction import Travel, advance


class Directions:
    """Direction of travel of each link from its scale; a sink of the loop.

    A recording of a few rows per second would miss a link that goes out and comes back between two rows.
    """

    def __init__(self, scales: Sequence[Wire]) -> None:
        self._wires = tuple((wire.slot, wire.sign) for wire in scales)
        self._travels = [Travel()] * len(self._wires)

    @property
    def now(self) -> list[int]:
        """(n,) +1 or -1; 0 before the link has moved."""
        return [int(travel.direction) for travel in self._travels]

    def update(self, setpoint: Setpoint) -> None:
        """Take the good readings of one cycle."""
        assert setpoint.inputs is not None
        readings = setpoint.inputs.snapshot.readings
        for link, (slot, sign) in enumerate(self._wires):
            value, _, quality, *_ = readings[slot]
            if quality is Quality.OK:
                self._travels[link] = advance(self._travels[link], sign * value)
