"""Scatter of a length's readings at rest, from the readings alone, without declared values.

The standard deviation about a straight line in windows of a second or more, so that a drift does not count, without
single readings that are damaged. A window counts where the readings stay within their tolerance, or go to and fro about
the same place: motion from one place to another crosses the line two or three times, noise and hum many times. The
median of the last windows counts, so that one in which the machine has moved all the same does no harm.

A hum that the polls alias to less than three periods in a window looks like motion, and does not count.

Windows take seconds. Until they tell, the last readings do, where they turn round from one to the next: a machine does
so at the end of a way, noise and hum again and again. So does a joint or the frame that changes while the scales stand:
it is no faster than the links (`compd.live.machine.wired_readings`).
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from compd.arrays import FloatArray
from compd.live.acquisition.possible_motion import GaugeSample

# Fewest readings and shortest duration (s) of a window. A standard deviation from 32 readings has an error of 13 %.
FEWEST = 32
WINDOW_S = 1.0
# Windows whose median counts, and the fewest of them.
_WINDOWS = 5
_MIN_WINDOWS = 2
# Fewest changes from one side of the line to the other, each by half a standard deviation beyond it: three periods. The
# residual of a move with one reversal has three or four such changes, that of noise 0.3 for each reading.
_MIN_CHANGES = 6
_BEYOND = 0.5
# Largest length of the line, in standard deviations, for readings about one place.
_STAYS = 2.0
# A reading this many median deviations from the middle is damaged. For noise 7 is 5 sigma; hum reaches 1.4.
_DAMAGED = 7.0
# Last readings whose turns and changes count, and the fewest turns that no machine makes.
_LAST = 32
_MIN_TURNS = 2
# Rounded to 1 pm, below its uncertainty, since a recording has it as text.
_DECIMALS_MM = 9


class RestScatter:
    """Scatter of one length in windows of readings."""

    def __init__(self, tolerance_mm: float) -> None:
        """`tolerance_mm`: largest difference of readings at rest."""
        self.mm = math.nan  #: standard deviation of one reading, mm; nan before there are enough
        self._tolerance_mm = tolerance_mm
        self._times_s: list[float] = []
        self._values_mm: list[float] = []
        self._windows: deque[float] = deque(maxlen=_WINDOWS)

    def note(self, sample: GaugeSample) -> None:
        """Add a reading; readings come in the order of time."""
        self._times_s.append(sample.time_s)
        self._values_mm.append(sample.value)
        if len(self._times_s) < FEWEST or sample.time_s - self._times_s[0] < WINDOW_S:
            return
        value_mm = np.array(self._values_mm)
        time_s = np.array(self._times_s)
        self._times_s.clear()
        self._values_mm.clear()
        off_mm = value_mm - np.median(value_mm)
        whole = np.abs(off_mm) <= _DAMAGED * max(float(np.median(np.abs(off_mm))), self._tolerance_mm)
        off_mm, went_mm = _off_line(time_s[whole], value_mm[whole])
        if len(off_mm) <= 2:
            return
        deviation_mm = math.sqrt(float(off_mm @ off_mm) / (len(off_mm) - 2))
        stands = float(np.ptp(value_mm[whole])) <= self._tolerance_mm
        stays = went_mm <= max(self._tolerance_mm, _STAYS * deviation_mm)
        if stands or (stays and _changes_of_side(off_mm, _BEYOND * deviation_mm) >= _MIN_CHANGES):
            self._windows.append(deviation_mm)
            if len(self._windows) >= _MIN_WINDOWS:
                self.mm = round(float(np.median(self._windows)), _DECIMALS_MM)


class LatestScatter:
    """Scatter of the last readings of one length, believed or not, that motion does not explain."""

    def __init__(self, tolerance_mm: float) -> None:
        """`tolerance_mm`: largest difference that is no turn."""
        self._tolerance_mm = tolerance_mm
        self._value = self._change = math.nan
        self._count = 0
        # each turn and change: the number of its reading, and its size (mm)
        self._turns: deque[tuple[int, float]] = deque()
        self._changes: deque[tuple[int, float]] = deque()

    def note(self, value: float, unexplained_mm: float = 0.0) -> None:
        """Add a reading. unexplained_mm : its change while the machine stood."""
        change, before = value - self._value, self._change
        self._value, self._change = value, change
        self._count += 1
        if change * before < 0.0 and (least := min(abs(change), abs(before))) > self._tolerance_mm:
            self._turns.append((self._count, least))
        if unexplained_mm > 0.0:
            self._changes.append((self._count, unexplained_mm))
        for sizes in (self._turns, self._changes):
            while sizes and sizes[0][0] <= self._count - _LAST:
                sizes.popleft()

    @property
    def mm(self) -> float:
        """The scatter (mm); nan if the readings show none.

        The mean size of turns is 1.0 standard deviations of noise, and 1.06 of hum. Of changes the largest counts: a
        single one may be all that is known.
        """
        turns_mm = [size for _, size in self._turns]
        shown_mm = [size for _, size in self._changes]
        if len(turns_mm) >= _MIN_TURNS:
            shown_mm.append(sum(turns_mm) / len(turns_mm))
        return round(max(shown_mm), _DECIMALS_MM) if shown_mm else math.nan


def _off_line(time_s: FloatArray, value_mm: FloatArray) -> tuple[FloatArray, float]:
    """Distances (mm) from the straight line that fits best, and how far that goes (mm)."""
    time_s, value_mm = time_s - time_s.mean(), value_mm - value_mm.mean()
    slope = float(time_s @ value_mm) / max(float(time_s @ time_s), 1e-12)
    return value_mm - slope * time_s, abs(slope) * float(np.ptp(time_s))


def _changes_of_side(off_mm: FloatArray, beyond_mm: float) -> int:
    sides = np.sign(off_mm[np.abs(off_mm) > beyond_mm])
    return int(np.count_nonzero(np.diff(sides)))
