"""What readings of temperatures, pressures and the rest are plausible where the configuration says nothing of it.

A quantity's range is the one beyond which a recording's columns are warned of (`compd.recording.checks`). How fast it
changes and how far it is from others of its kind depends on its unit; of a force or a length nothing is known.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from compd.live.acquisition.quantity_trust import QuantityLimits
from compd.operation_settings import QuantityWire
from compd.recording import limit_of
from compd.stated_noise import SAME_VALUE_SIGMAS
from compd.units import unit_of

_S_PER_H = 3600.0


class UnitLimits(NamedTuple):
    """Of quantities of one unit, in it. fastest_per_s, apart, tolerance, usual_per_h : as of `QuantityLimits`, the last
    per hour; reason : of each."""

    fastest_per_s: float
    apart: float
    tolerance: float
    usual_per_h: float
    reason: str


UNIT_LIMITS: Mapping[str, UnitLimits] = {
    "degC": UnitLimits(
        0.2, 15.0, 0.25, 10.0,
        "steel takes 470 J/(kg K), so 0.2 K/s are 94 W in each kilogram; what an empty register shows, 0 degC, is "
        "further from 20 degC than parts of a measuring machine from each other; modules count in 0.1 degC; a machine "
        "that is switched on warms up by some 10 K in an hour",
    ),
    "hPa": UnitLimits(
        0.1, math.inf, 1.0, 5.0,
        "weather changes the air pressure by some hPa an hour; doors and ventilation by tenths of hPa at once",
    ),
    "pct": UnitLimits(
        3.0, math.inf, 5.0, 20.0,
        "a polymer sensor takes 8 s to follow air that is 25 % drier; sensors err by 2 to 3 %; rooms change by tens of "
        "percent in an hour",
    ),
}  # fmt: skip
_UNKNOWN = UnitLimits(math.inf, math.inf, 0.0, math.inf, "")


def quantity_limits(wire: QuantityWire) -> QuantityLimits:
    """What readings of a wired quantity are plausible: what its entry says, else what its name and its unit say."""
    unit = UNIT_LIMITS.get(unit_of(wire.name), _UNKNOWN)
    column = limit_of(wire.name)
    low, high = wire.plausible or ((-math.inf, math.inf) if column is None else (column.low, column.high))
    return QuantityLimits(
        low,
        high,
        unit.fastest_per_s if wire.fastest_change is None else wire.fastest_change,
        unit.apart if wire.apart is None else wire.apart,
        max(unit.tolerance, SAME_VALUE_SIGMAS * (wire.noise or 0.0)),
        unit.usual_per_h / _S_PER_H,
    )
