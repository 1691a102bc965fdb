"""An OPC UA server's nodes as described for a gauge: numbers, or arrays of numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from compd.twins import SimulatedPushedDevice
from compd_drivers.simulated.shared import number_for


class SimulatedNodes(SimulatedPushedDevice):
    """One node for each channel, or for several that are entries of one array; nan where a sensor is off."""

    def say(self, utc_s: float) -> Mapping[str, Any]:
        values: dict[str, Any] = {}
        for channel in self.options.channels:
            value = self.sense(channel.name)
            number = number_for(channel, value) / channel.scale if math.isfinite(value) else math.nan
            if channel.index is None:
                values[channel.node] = number
            else:
                array = values.setdefault(channel.node, [])
                array += [0.0] * (channel.index + 1 - len(array))
                array[channel.index] = number
        return values
