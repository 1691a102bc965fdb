"""The skew of a setpoint: how far apart in time the lengths were measured of which it was computed.

Gauges that share a line are read one after the other, and each line has its own pace. While the machine moves, a
setpoint mixes places at which it was at different times: at 1 mm/s, lengths that are 100 ms apart are 100 um apart.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from compd.gauge import Reading
from compd.live.machine import Wire
from compd.live.memory import Snapshot


def skew_between(length_times_s: Sequence[float], oldest_s: float, newest_s: float) -> float:
    """Seconds from the oldest to the newest length; nan where one of the times is not known.

    length_times_s : monotonic times (s) of the oldest and the newest comparator; empty where they are not known.
    oldest_s, newest_s : the same of the scales; inf and -inf where none is used.
    """
    if not length_times_s:
        return math.nan
    return max(length_times_s[1], newest_s) - min(length_times_s[0], oldest_s)


def skew_of(readings: Iterable[Reading]) -> float:
    """Seconds from the oldest to the newest of these readings; nan without any."""
    times_s = [reading.time_s for reading in readings]
    return max(times_s) - min(times_s) if times_s else math.nan


def skew_reason(wires: Sequence[Wire], snapshot: Snapshot, allowed_s: float) -> str:
    """Why a snapshot is refused whose lengths, of these wires, are more than `allowed_s` (s) apart."""
    oldest, newest = (pick(wires, key=lambda wire: snapshot.readings[wire.slot].time_s) for pick in (min, max))
    skew_s = snapshot.readings[newest.slot].time_s - snapshot.readings[oldest.slot].time_s
    return (
        f"the readings are {skew_s * 1e3:.0f} ms apart, allowed {allowed_s * 1e3:g} ms (`loop.skew_s`): the oldest is "
        f"{oldest.meaning} ({oldest.channel}), the newest {newest.meaning} ({newest.channel})"
    )
