"""A reading: the value of one channel of a gauge at one time, or the reason why there is none."""

from __future__ import annotations

import math
from enum import StrEnum
from typing import NamedTuple, Self


class Quality(StrEnum):
    """Whether a reading has a value, and if not, why. Only OK carries a number. text : meaning, for people."""

    text: str

    def __new__(cls, name: str, text: str = "") -> Self:
        quality = str.__new__(cls, name)
        quality._value_ = name
        quality.text = text
        return quality

    OK = "ok", "there is a value"
    NEVER_READ = "never_read", "nothing has been asked yet"
    TIMEOUT = "timeout", "no byte came"
    INCOMPLETE = "incomplete", "the reply was cut short"
    CRC = "crc", "a checksum or parity does not fit"
    MISMATCH = "mismatch", "a whole reply came, but not to what was asked"
    DEVICE_ERROR = "device_error", "the device answered with an error of its own"
    OVER_RANGE = "over_range", "the device says that the value is above its range"
    UNDER_RANGE = "under_range", "the device says that the value is below its range"
    SENSOR_FAULT = "sensor_fault", "the device says that its sensor is faulty or absent"
    NOT_FINITE = "not_finite", "the reply is no finite number, or one that stands for none, such as 9.9E37"
    SILENT = "silent", "the device is silent by design, for instance in its menu, and not lost"
    LINE_LOST = "line_lost", "the port is gone; the line is opened again after a pause"
    DRIVER_ERROR = "driver_error", "the driver itself failed: a defect in it, to be reported"
    STALE = "stale", "there was a value, which is too old now"
    DISTRUSTED = "distrusted", "there is a value, which is not believed before a person has accepted it: `compd accept`"


# No quantity of a machine is as large, in any unit.
LARGEST_READING = 1e20
# Numbers that instruments send in place of a reading. SCPI 1999, volume 1, 7.2.1: 9.9E37 is infinity, 9.91E37 is not a
# number; others: the largest numbers of 32 and 64 bits, and NetCDF's 9.97E36. As float32 they differ in the 8th digit.
_PLACEHOLDERS = (9.9e37, 9.91e37, 3.4028235e38, 1.7976931348623157e308, 9.969209968386869e36)


def stands_for_no_number(value: float) -> bool:
    """Whether a number is one that instruments send in place of a reading: SCPI's 9.9E37, 9.91E37 and their kind."""
    size = abs(value)
    return size >= LARGEST_READING and any(math.isclose(size, other, rel_tol=1e-4) for other in _PLACEHOLDERS)


def is_reading(value: float) -> bool:
    """Whether a number can be a reading: finite, and not as large as what instruments send in place of one."""
    return abs(value) < LARGEST_READING


# Intervals of a gauge's readings after which the next one is due.
ROUNDS_UNTIL_DUE = 2.5


class ReadingMotion(NamedTuple):
    """How what a length gauge measures moves, by its own last readings. compd finds it; a driver leaves it out.

    Attributes
    ----------
    speed_mm_per_s : at the time of the reading, mm/s; 0 where it does not move, or not steadily.
    braking_mm_per_s2 : by how much its size falls, mm/s2; 0 where it does not brake.
    u_mm_per_s : standard uncertainty of the speed, mm/s; nan where there are not enough readings yet.
    horizon_s : time (s) after a reading for which the motion may be assumed to go on.
    mean_mm_per_s : mean speed over the last `window_s`, as the readings show it, mm/s; 0 where none is known.
    window_s : how long before the reading the first one is that counts for `mean_mm_per_s`, s.
    due_s : latest time (s) of the next reading after this one, unless the gauge is silent.
    scatter_mm : standard deviation of one reading at rest, as the last ones show it, mm; nan before it is known.
    rest_s : time (s) without motion in the last readings.
    late_s : by how much later than the reading's time the device may have sampled, s.
    """

    speed_mm_per_s: float
    braking_mm_per_s2: float
    u_mm_per_s: float = math.nan
    horizon_s: float = 0.0
    mean_mm_per_s: float = 0.0
    window_s: float = 0.0
    due_s: float = 0.0
    scatter_mm: float = math.nan
    rest_s: float = 0.0
    late_s: float = 0.0


class Reading(NamedTuple):
    """One channel of one gauge at one time. Drivers make it by `good` and `bad`.

    Attributes
    ----------
    value : in the channel's unit (mm for every length); nan unless `quality` is OK.
    time_s : monotonic time (s) at which the request had left the port. It is the earliest time at which the device can
        have sampled, so that the age of a reading is never understated.
    quality : OK, or the reason why there is no value.
    detail : what the device sent or the line saw, for a person ("ER,MS,31"); "" when OK.
    motion : of a length, where compd knows it; drivers leave it out.
    """

    value: float
    time_s: float
    quality: Quality
    detail: str = ""
    motion: ReadingMotion | None = None

    @property
    def ok(self) -> bool:
        """Whether there is a value."""
        return self.quality is Quality.OK


def good(value: float, time_s: float) -> Reading:
    """A reading with a value, in the channel's unit.

    A value that is not finite, or so large that it stands for no number, becomes `bad` with NOT_FINITE.
    """
    if not is_reading(value):
        return bad(time_s, Quality.NOT_FINITE, repr(value))
    return Reading(value, time_s, Quality.OK)


def bad(time_s: float, quality: Quality, detail: str = "") -> Reading:
    """A reading without a value: its quality is the reason, `detail` what was seen."""
    return Reading(math.nan, time_s, quality, detail)


class LineFault(Exception):
    """A poll that failed as a whole: every channel of the gauge takes this quality.

    Lines raise it for what happens to the bytes, drivers for a reply that cannot be used (MISMATCH, CRC, DEVICE_ERROR).
    """

    def __init__(self, quality: Quality, detail: str = "") -> None:
        super().__init__(f"{quality}: {detail}" if detail else str(quality))
        self.quality = quality
        self.detail = detail
