"""Motion of the length that a gauge measures, estimated from its last readings.

The speed is the slope over as many of the last readings as it takes for the length to change by more than its readings
scatter: over the last interval while the machine travels, over up to a second of slow drift. So little noise enters,
and little delay (first-order adaptive windowing: F. Janabi-Sharifi, V. Hayward, C.-S. J. Chen, Discrete-time adaptive
windowing for velocity estimation, IEEE Trans. Control Systems Technology 8 (2000) 1003-1009).

The slopes of the windows before, each as long, say more:

- A speed counts where the window before shows it too: a single step is no motion to be carried on. It counts where the
  last interval shows it, too: a part that has come to rest since is at rest.
- Where the slope falls from window to window, the part brakes: it is carried on to its standstill, and not beyond. One
  that becomes faster is carried on with the speed that it has, since it may stop to do so at any time.
- What the slope has changed by from one window to the next, within a second, it may change by again: that is its
  uncertainty, with what the delays of the first and the last reading of the window make of it.

It also says until when the next reading is due: a gauge that is silent for longer may have begun to move. And for how
long there was no motion: a part that has just come to rest may leave again unnoticed.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from itertools import pairwise
from statistics import median

from compd.gauge import ReadingMotion
from compd.live.acquisition.possible_motion import GaugeSample
from compd.reading import ROUNDS_UNTIL_DUE
from compd.stated_noise import DIFFERENCE_SIGMAS

# Longest window (s) of a speed; an older drift says little about the present.
MAX_WINDOW_S = 1.0
# Largest growth of a speed from one window to the next: the factor at which a slope limiter does not overshoot (P. K.
# Sweby, SIAM J. Numer. Anal. 21 (1984) 995-1011).
MAX_GROWTH = 2.0
# Age (rounds) at which a reading is replaced: one round, or two for a reading that waits for the end of its round.
HORIZON_ROUNDS = 2.0
# The usual round time is the median of this many last rounds.
_USUAL_ROUNDS = 5
# Rounds without motion that show a rest; a part that reverses shows one of them.
_CALM_ROUNDS = 2
# Longest time (s) that a motion is assumed to continue; drives stop from full speed within 0.1 to 0.3 s.
MAX_HORIZON_S = 0.15
# Width of a uniform distribution over its standard deviation (GUM, 4.3.7).
_UNIFORM = math.sqrt(12.0)
# Least duration of a window as a share of the last one; polls scatter.
_AS_LONG = 0.9
# Rounded to 1 pm/s and 1 us, below every uncertainty, since a recording has each of them as text.
_DECIMALS_MM, _DECIMALS_S = 9, 6
# Every fourth reading is kept to detect a rest. They cover 128 readings: some 2 s of a scale, 6 s of a slow line.
_KEPT_EVERY, _KEPT = 4, 32
UNKNOWN = ReadingMotion(0.0, 0.0, math.nan, 0.0)
# How many fields of a motion, from the first, the speeds give.
_SPEEDS = ReadingMotion._fields.index("scatter_mm")


def estimated_motion(history: Sequence[GaugeSample], tolerance_mm: float) -> ReadingMotion:
    """The motion at the last of these readings, which are ordered by time.

    tolerance_mm : by which two readings of the same value may differ, mm.
    """
    history = list(history)  # of a deque, which is slower to index
    last = len(history) - 1
    start = _window_start(history, last, tolerance_mm) if last > 0 else last
    duration_s = history[last].time_s - history[start].time_s
    if duration_s <= 0.0:
        return UNKNOWN
    rounds = [later.time_s - earlier.time_s for earlier, later in pairwise(history[-_USUAL_ROUNDS - 1 :])]
    horizon_s = min(HORIZON_ROUNDS * max(rounds[-2:]), MAX_HORIZON_S)
    due_s = ROUNDS_UNTIL_DUE * median(rounds)
    recent = _recent_speed(history, tolerance_mm)
    if _stands(history, start, recent, tolerance_mm):
        start = last - _CALM_ROUNDS
        duration_s = history[last].time_s - history[start].time_s
    slopes = _slopes(history, start, duration_s)
    now = slopes[0]
    as_measured = now, duration_s, due_s
    if abs(history[last].value - history[start].value) <= tolerance_mm:
        return _rounded(0.0, 0.0, abs(now), horizon_s, 0.0, rounds[-1], due_s)
    changes = [abs(later - earlier) for later, earlier in pairwise(slopes)]
    late_s = math.hypot(history[start].window_s, history[last].window_s) / _UNIFORM
    u = math.hypot(
        max(changes, default=abs(now)), tolerance_mm / DIFFERENCE_SIGMAS / duration_s, abs(now) * late_s / duration_s
    )
    if recent < math.inf:  # the speed before that no longer counts
        u = min(u, max(recent, abs(now)))
    before = slopes[1] if len(slopes) > 1 else 0.0
    if now * before <= 0.0 or _has_stopped(history, now, tolerance_mm):
        return _rounded(0.0, 0.0, max(u, abs(now)), horizon_s, *as_measured)
    if abs(now) >= abs(before):
        speed = math.copysign(min(abs(now), MAX_GROWTH * abs(before)), now)
        return _rounded(speed, 0.0, max(u, abs(now - speed)), horizon_s, *as_measured)
    braking = (abs(before) - abs(now)) / duration_s
    speed = abs(now) - braking * duration_s / 2  # the slope is the speed in the middle of the window
    if speed <= 0.0:
        return _rounded(0.0, 0.0, u, horizon_s, *as_measured)
    return _rounded(math.copysign(speed, now), braking, u, min(horizon_s, speed / braking), *as_measured)


def _window_start(history: Sequence[GaugeSample], last: int, tolerance_mm: float) -> int:
    """Start of the shortest window in which the length has changed, or of the longest window."""
    newest_mm, newest_s, _ = history[last]
    start = last - 1
    for k in range(last - 1, -1, -1):
        value_mm, time_s, _ = history[k]
        if newest_s - time_s > MAX_WINDOW_S and k < last - 1:
            break
        start = k
        if abs(newest_mm - value_mm) > tolerance_mm:
            break
    return start


def _recent_speed(history: Sequence[GaugeSample], tolerance_mm: float) -> float:
    """The absolute speed (mm/s) over the last two rounds if neither shows motion; else inf."""
    if len(history) <= _CALM_ROUNDS:
        return math.inf
    newest = history[-1]
    if any(abs(newest.value - history[-1 - k].value) > tolerance_mm for k in range(1, _CALM_ROUNDS + 1)):
        return math.inf
    since = history[-1 - _CALM_ROUNDS]
    passed_s = newest.time_s - since.time_s
    return abs(newest.value - since.value) / passed_s if passed_s > 0.0 else math.inf


def _stands(history: Sequence[GaugeSample], start: int, recent: float, tolerance_mm: float) -> bool:
    """Whether a part has come to rest within the window that begins at `start`: its speed there would show in the last
    rounds. recent : as of `_recent_speed`.
    """
    if recent == math.inf or start >= len(history) - 1 - _CALM_ROUNDS:
        return False
    newest, since, begin = history[-1], history[-1 - _CALM_ROUNDS], history[start]
    speed = abs(newest.value - begin.value) / (newest.time_s - begin.time_s)
    return (speed - recent) * (newest.time_s - since.time_s) > tolerance_mm


def _has_stopped(history: Sequence[GaugeSample], speed: float, tolerance_mm: float) -> bool:
    """Whether the last interval shows no motion, though `speed` (mm/s), that of its window, would show in it."""
    newest, before = history[-1], history[-2]
    shown_mm = abs(newest.value - before.value)
    return shown_mm <= tolerance_mm < abs(speed) * (newest.time_s - before.time_s) - shown_mm


def _slopes(history: Sequence[GaugeSample], start: int, duration_s: float) -> list[float]:
    """Mean speeds (mm/s): from `start` to the last reading, then of whole windows as long before it, the latest first.

    Windows that ended more than MAX_WINDOW_S ago do not count.
    """
    end_mm, end_s, _ = history[start]
    newest_mm, newest_s, _ = history[-1]
    slopes = [(newest_mm - end_mm) / duration_s]
    for k in range(start - 1, -1, -1):
        if newest_s - end_s > MAX_WINDOW_S:
            break
        value_mm, time_s, _ = history[k]
        passed_s = end_s - time_s
        if passed_s >= _AS_LONG * duration_s:
            slopes.append((end_mm - value_mm) / passed_s)
            end_mm, end_s = value_mm, time_s
    return slopes


def _rounded(
    speed: float, braking: float, u: float, horizon_s: float, mean: float, window_s: float, due_s: float
) -> ReadingMotion:
    return ReadingMotion(
        round(speed, _DECIMALS_MM),
        round(braking, _DECIMALS_MM),
        round(u, _DECIMALS_MM),
        round(horizon_s, _DECIMALS_S),
        round(mean, _DECIMALS_MM),
        round(window_s, _DECIMALS_S),
        round(due_s, _DECIMALS_S),
    )


class MotionEstimate:
    """The motion of one length: how it goes on, for how long it has stood, and how late its last sample may be."""

    def __init__(self, tolerance_mm: float) -> None:
        """`tolerance_mm`: by which two readings of the same value may differ."""
        self._tolerance_mm = tolerance_mm
        self._kept: deque[GaugeSample] = deque(maxlen=_KEPT)
        self._count = 0

    def note(self, history: Sequence[GaugeSample], scatter_mm: float = math.nan) -> ReadingMotion:
        """The motion at the last of these readings, of which the others have been noted before.

        scatter_mm : of the length at rest.
        """
        sample = history[-1]
        speeds = estimated_motion(history, self._tolerance_mm)[:_SPEEDS]
        # in the order of the fields: `_replace` takes three times as long
        late_s = round(sample.window_s, _DECIMALS_S)
        return ReadingMotion._make((*speeds, scatter_mm, self._rest_s(sample), late_s))

    def _rest_s(self, sample: GaugeSample) -> float:
        """Since when readings have been near this one, s. Slow drifts are no motion."""
        kept = self._kept
        while kept and abs(sample.value - kept[0].value) > self._tolerance_mm:
            kept.popleft()
        if not kept or self._count >= _KEPT_EVERY:
            kept.append(sample)
            self._count = 0
        self._count += 1
        return round(sample.time_s - kept[0].time_s, _DECIMALS_S)
