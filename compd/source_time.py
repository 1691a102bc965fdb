"""When a value was measured that a device has sent unsolicited: by the time that came with it, or by its arrival.

    source    t = arrived - (calendar time of arrival - calendar time of the source), at most `arrived`
    arrival   t = the earliest time that the protocol allows, where it allows one; else `arrived`

The device's clock and this computer's must agree for the first (NTP, PTP). A time in the future shows that they do
not: the arrival counts then, and a note says so. A time in the past is believed, however old the value is by it: one
that was held up on its way looks exactly like one of a clock that is slow.

Where only the arrival is known, nothing tells a value that was held up from a new one, but for the period in which they
come: after a pause of more than `LATE` periods, all that comes within the next period may be old.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

TimeFrom = Literal["source", "arrival"]
# Largest lead (s) of a clock over this computer's; a larger one counts as wrong. NTP keeps it within 0.01 s on a LAN.
CLOCK_TOLERANCE_S = 0.1
# So far two readings of this computer's clocks, s, are apart at most: times that differ by less are the same.
SAME_TIME_S = 1e-3
# In periods: after a longer pause, values may have been held up on the way.
LATE = 1.5


class Arrival(NamedTuple):
    """How a value came.

    Attributes
    ----------
    arrived_s : monotonic time of its arrival, s.
    arrived_utc_s : the same by this computer's calendar clock, s since 1970, UTC.
    earliest_s : the earliest monotonic time, s, at which it can have been measured, where the protocol tells; else nan.
    holds : it still held at `earliest_s`, whenever it was measured.
    kept : retained from before, since an unknown time.
    """

    arrived_s: float
    arrived_utc_s: float
    earliest_s: float = math.nan
    holds: bool = False
    kept: bool = False


class MeasurementTime(NamedTuple):
    """Of one value.

    time_s : monotonic, s; never after its arrival. window_s : by how much later it may have been measured, s.
    note : what is wrong with the source's clock, though there is a time; "" if nothing.
    """

    time_s: float
    window_s: float
    note: str = ""


class AgeUnknownError(ValueError):
    """The value's age is unknown."""


class OutOfOrderError(ValueError):
    """A value that was measured before the last one."""


class SourceTime:
    """The times of one channel's values, in the order of their arrival."""

    def __init__(self, time_from: TimeFrom, period_s: float | None = None) -> None:
        """`period_s`: the longest time from one value to the next, s, where only the arrival is known."""
        self._time_from = time_from
        self._period_s = period_s
        self._last_s = -math.inf
        self._arrived_s = math.nan  # of the value before
        self._held_up_until_s = -math.inf

    def of(self, arrival: Arrival, source_utc_s: float, resolution_s: float) -> MeasurementTime:
        """The time of a value. Raises AgeUnknownError or OutOfOrderError where there is none that counts.

        source_utc_s : time that came with it, s since 1970, UTC; nan if none did. resolution_s : its last digit, s.
        """
        self._note_arrival(arrival.arrived_s)
        time = self._by_source(arrival, source_utc_s, resolution_s) or self._by_arrival(arrival, source_utc_s)
        before_s = self._last_s - time.time_s
        if before_s > SAME_TIME_S and not arrival.holds:
            raise OutOfOrderError(f"measured {before_s:.3g} s before the last value: out of order")
        if before_s > 0:
            time = time._replace(time_s=min(self._last_s, arrival.arrived_s))
        self._last_s = time.time_s
        return time

    def _by_source(self, arrival: Arrival, source_utc_s: float, resolution_s: float) -> MeasurementTime | None:
        if self._time_from == "arrival" or math.isnan(source_utc_s):
            return None
        age_s = arrival.arrived_utc_s - source_utc_s
        if age_s < -CLOCK_TOLERANCE_S:
            return None
        time_s = arrival.arrived_s - max(age_s, 0.0)
        if arrival.holds and time_s < arrival.earliest_s:
            return MeasurementTime(arrival.earliest_s, arrival.arrived_s - arrival.earliest_s)
        return MeasurementTime(time_s, min(resolution_s, arrival.arrived_s - time_s))

    def _by_arrival(self, arrival: Arrival, source_utc_s: float) -> MeasurementTime:
        note = ""
        if self._time_from == "source" and not math.isnan(source_utc_s):
            ahead_s = source_utc_s - arrival.arrived_utc_s
            note = f"the source's clock is {ahead_s:.3g} s ahead of this computer's: the time of arrival counts"
        if arrival.kept:
            raise AgeUnknownError("was kept from before, without a time that counts: nobody knows how old it is")
        if arrival.arrived_s < self._held_up_until_s:
            raise AgeUnknownError(
                f"came after a pause of more than {LATE:g} periods of {self._period_s:g} s, without a time "
                "that counts: it may have been held up"
            )
        if math.isnan(arrival.earliest_s):
            return MeasurementTime(arrival.arrived_s, 0.0, note)
        return MeasurementTime(arrival.earliest_s, arrival.arrived_s - arrival.earliest_s, note)

    def _note_arrival(self, arrived_s: float) -> None:
        before_s, self._arrived_s = self._arrived_s, arrived_s
        if self._period_s is not None and arrived_s - before_s > LATE * self._period_s:
            self._held_up_until_s = arrived_s + self._period_s
