"""Whether the readings of a temperature, a force, a pressure are believed.

A quantity is plausible where it lies in its range, near its neighbours (the other quantities of the same unit), and
where it has not changed faster than it can. What it can have become is followed from reading to reading: by no more
than its fastest change. So a jump shows at once, a ramp that is too fast after a moment, and noise by its size. That
is published, and not the reading: scatter that the quantity itself cannot have does not reach the correction.

Quantities move slowly beside lengths, so that there is time: an implausible reading is not published, and the last one
stays as long as it is not stale. A quantity that was implausible for a second, less what it was plausible since, is
not believed any more. It is believed again when it has come back to what it showed before, as far as it usually drifts,
for a second; else a person accepts it. One that was away may have changed meanwhile as fast as it can.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from compd.gauge import Quality, Reading, bad
from compd.live.acquisition.possible_motion import GaugeSample
from compd.live.memory import Doubt, TrustMemory

# Longest time (s) that a quantity may be implausible: beyond a burst of interference, below the usual `loop.hold_s`.
LASTING_S = 1.0
# Largest share (s) of that time that one reading counts for, also for a gauge that is polled seldom.
_MAX_SHARE_S = LASTING_S / 5
# A quantity begins at the median of this many readings, or of those within this time (s), so that a single reading does
# not decide for all that follow. Its neighbours are awaited for the same time.
_MIN_FIRST, MAX_START_S = 5, 1.0
# Age (s) from which a neighbour's reading no longer counts.
_OLD_S = 60.0
_MIN_NEIGHBOURS = 2
# What has come back is this much nearer to what it was than while it was wrong.
_BACK_SHARE = 0.25


_LOST = float(Doubt.LOST)
# Doubts of which a quantity's own readings tell when they are over.
_MAY_COME_BACK = (Doubt.JUMPED, Doubt.IMPLAUSIBLE, Doubt.APART)


class QuantityLimits(NamedTuple):
    """Plausible readings of a quantity in its unit; infinite where unknown.

    low, high : its range. fastest_per_s : its fastest change, per second. apart : the largest difference from its
    neighbours. tolerance : by which two readings of the same value may differ. usual_per_s : its usual drift, per
    second.
    """

    low: float = -math.inf
    high: float = math.inf
    fastest_per_s: float = math.inf
    apart: float = math.inf
    tolerance: float = 0.0
    usual_per_s: float = math.inf


class _Fault(NamedTuple):
    """Reason why a reading is implausible, as `TrustMemory` keeps it and in words."""

    doubt: Doubt
    amount: float
    text: str


class QuantityTrust:
    """Judges the readings of one channel as `ReadingTrust` does those of a length; used by its line's thread."""

    def __init__(self, memory: TrustMemory, channel: str, limits: QuantityLimits) -> None:
        self._memory = memory
        self._i = i = memory.index[channel]
        self._limits = limits
        self._unit = memory.unit(i)
        self._neighbours = [
            j for j in range(memory.lengths, len(memory.channels)) if j != i and memory.unit(j) == self._unit
        ]
        self._expected = math.nan  # follows the readings at the fastest change at most
        self._expected_s = math.nan
        self._implausible_s = 0.0
        self._back_s = 0.0  # for how long it has been back
        self._judged_s = math.nan
        self._begun_s = math.nan
        self._first: list[Reading] = []  # the last readings since `_begun_s`

    def surprises(self, sample: GaugeSample) -> bool:
        """Whether a second answer is needed, for a good reading that is implausible or the first one."""
        memory, i = self._memory, self._i
        if memory.accepted[i] != memory.obeyed[i]:
            return True
        if memory.doubt_of(i).until_accepted:
            return False
        return not self._recall() or self._fault(sample.value, sample.time_s) is not None

    def fail(self, quality: Quality, now_s: float) -> None:
        """Note a poll without a value, which may end an order; how far it has gone, its fastest change limits."""
        if quality is Quality.LINE_LOST:
            self._memory.end_order(self._i)

    def show(self, reading: Reading) -> None:
        """As of `ReadingTrust.show`."""
        self._memory.show(self._i, reading.value, reading.time_s)

    def judge(self, reading: Reading, window_s: float, first: Reading | None = None) -> Reading:
        """The reading as it may be published; parameters as of `ReadingTrust.judge`."""
        memory, i = self._memory, self._i
        self.show(reading)
        if memory.accepted[i] != memory.obeyed[i] and first is not None:
            return self._judge_after_acceptance(reading, first)
        if memory.voted[i] != memory.handled[i]:
            memory.handled[i] = memory.voted[i]
            memory.distrust(i, Doubt.VOTED, math.nan)
        share_s = self._share_s(reading.time_s)
        if memory.doubt_of(i).until_accepted and not self._is_back(reading, share_s):
            return bad(reading.time_s, Quality.DISTRUSTED, memory.explanation(i))
        known = self._recall()
        candidates = (reading,) if first is None else (reading, first)
        faults = [self._fault(each.value, each.time_s) for each in candidates]
        for each, fault in zip(candidates, faults, strict=True):
            if fault is None:
                if not any(faults):  # one plausible answer of two does not predict the next poll
                    self._implausible_s = max(0.0, self._implausible_s - share_s)
                if not known:
                    return self._begin(each, candidates)
                return self._hold(each) if any(faults) or self._implausible_s > 0.0 else self._accept(each)
        assert faults[0] is not None
        self._implausible_s += share_s
        if self._implausible_s < LASTING_S:
            return bad(reading.time_s, Quality.MISMATCH, faults[0].text)
        return self._distrust(reading, faults[0])

    def _is_back(self, reading: Reading, share_s: float) -> bool:
        """Whether a quantity that is not believed shows again, and for long enough, what it showed before."""
        memory, i = self._memory, self._i
        if memory.doubt_of(i) not in _MAY_COME_BACK or math.isnan(memory.value[i]):
            return False
        amount, away = float(memory.amount[i]), reading.value - float(memory.value[i])
        was_away = amount - float(memory.value[i]) if memory.doubt_of(i) is Doubt.IMPLAUSIBLE else amount
        drift = self._limits.usual_per_s * (reading.time_s - float(memory.time_s[i]))
        near = abs(away) <= min(self._limits.tolerance + drift, _BACK_SHARE * abs(was_away))
        self._expected = math.nan
        if not near or self._fault(reading.value, reading.time_s) is not None:
            self._back_s = 0.0
            return False
        self._back_s += share_s
        if self._back_s < LASTING_S:
            return False
        self._expected, self._expected_s = reading.value, reading.time_s
        memory.believe(i, reading.value, reading.time_s)
        return True

    def _recall(self) -> bool:
        """Whether a reading is known that the next one follows; that of another process counts, too."""
        memory, i = self._memory, self._i
        if memory.doubt_of(i) is Doubt.LOST:  # since a daemon has ended; the time since then is unknown
            memory.value[i], memory.doubt[i] = math.nan, Doubt.NONE
            self._expected = math.nan
        elif math.isnan(self._expected) and not math.isnan(memory.value[i]):
            self._expected, self._expected_s = float(memory.value[i]), float(memory.time_s[i])
        return not math.isnan(self._expected)

    def _judge_after_acceptance(self, reading: Reading, first: Reading) -> Reading:
        """The readings after a person's acceptance: two plausible ones must agree, whatever came before."""
        memory, i = self._memory, self._i
        self._expected, self._implausible_s = math.nan, 0.0
        fault = self._fault(reading.value, reading.time_s)
        if fault is None and (unconfirmed := self._unconfirmed((reading, first))):
            return unconfirmed
        memory.end_order(i)
        memory.handled[i] = memory.voted[i]
        return self._distrust(reading, fault) if fault else self._from(reading.value, reading)

    def _begin(self, reading: Reading, answers: tuple[Reading, ...]) -> Reading:
        """The first readings: two answers agree, and the neighbours, if there are any, have been read."""
        if unconfirmed := self._unconfirmed(answers):
            return unconfirmed
        if not self._first:
            self._begun_s = min(answer.time_s for answer in answers)
        self._first = [*self._first[1 - _MIN_FIRST :], reading]
        passed_s = reading.time_s - self._begun_s
        values = [each.value for each in self._first]
        if math.isfinite(self._limits.fastest_per_s):
            if len(values) < _MIN_FIRST and passed_s < MAX_START_S:
                return bad(reading.time_s, Quality.MISMATCH, "has been read too few times yet")
            scatter, possible = max(values) - min(values), self._possible_change(reading.time_s, self._first[0].time_s)
            if scatter > 2 * self._limits.tolerance + possible:
                return self._scattering(reading, scatter)
        unread = np.isnan(self._memory.shown[self._neighbours]).any() and math.isfinite(self._limits.apart)
        if unread and passed_s < MAX_START_S:
            return bad(reading.time_s, Quality.MISMATCH, "its neighbours have not been read yet")
        return self._from(float(np.median(values)), reading)

    def _scattering(self, reading: Reading, scatter: float) -> Reading:
        """Readings that scatter from the start: a later agreement is chance."""
        self._implausible_s += min(reading.time_s - self._first[-2].time_s, _MAX_SHARE_S)
        if self._implausible_s >= LASTING_S:
            return self._distrust(reading, _Fault(Doubt.JUMPED, scatter, ""))
        return bad(reading.time_s, Quality.MISMATCH, f"its first readings scatter by {scatter:.3g} {self._unit}")

    def _unconfirmed(self, answers: tuple[Reading, ...]) -> Reading | None:
        """Reason why two answers, the last one first, disagree; None if they agree."""
        reading = answers[0]
        if len(answers) < 2:
            return bad(reading.time_s, Quality.MISMATCH, f"{reading.value:g} is not confirmed by a second answer")
        one, other = answers
        if abs(one.value - other.value) > self._limits.tolerance + self._possible_change(one.time_s, other.time_s):
            return bad(reading.time_s, Quality.MISMATCH, f"two answers disagree: {other.value:g}, {one.value:g}")
        return None

    def _from(self, value: float, reading: Reading) -> Reading:
        """Follow the readings from this value on."""
        self._first.clear()
        self._expected, self._expected_s = value, reading.time_s
        return self._accept(reading)

    def _accept(self, reading: Reading) -> Reading:
        change = self._possible_change(reading.time_s, self._expected_s)
        self._expected = min(max(reading.value, self._expected - change), self._expected + change)
        self._expected_s = reading.time_s
        self._memory.believe(self._i, self._expected, reading.time_s)
        return reading._replace(value=self._expected)

    def _hold(self, reading: Reading) -> Reading:
        """A plausible reading among implausible ones: chance, for a noisy quantity or one that runs away."""
        self._expected_s = reading.time_s
        self._memory.believe(self._i, self._expected, reading.time_s)
        return reading._replace(value=self._expected)

    def _distrust(self, reading: Reading, fault: _Fault) -> Reading:
        self._implausible_s = self._back_s = 0.0
        self._memory.distrust(self._i, fault.doubt, fault.amount)
        return bad(reading.time_s, Quality.DISTRUSTED, self._memory.explanation(self._i))

    def _share_s(self, time_s: float) -> float:
        """Time (s) that a reading counts for."""
        passed_s, self._judged_s = time_s - self._judged_s, time_s
        return min(max(passed_s, 0.0), _MAX_SHARE_S) if math.isfinite(passed_s) else 0.0

    def _fault(self, value: float, time_s: float) -> _Fault | None:
        """Reason why a value at this time is implausible; None if it is plausible."""
        limits, unit = self._limits, self._unit
        if not limits.low <= value <= limits.high:
            text = f"{value:g} {unit}, plausible {limits.low:g} to {limits.high:g} {unit}"
            return _Fault(Doubt.IMPLAUSIBLE, value, text)
        if not math.isnan(self._expected):
            away = value - self._expected
            if abs(away) > limits.tolerance + self._possible_change(time_s, self._expected_s):
                text = f"{value:g} {unit}, {away:+.3g} at once, fastest {limits.fastest_per_s:g} a second"
                return _Fault(Doubt.JUMPED, away, text)
        if math.isfinite(limits.apart) and len(self._neighbours) >= _MIN_NEIGHBOURS:
            return self._apart(value, time_s)
        return None

    def _possible_change(self, time_s: float, since_s: float) -> float:
        """Largest possible change between two times (s), in the quantity's unit."""
        fastest = self._limits.fastest_per_s
        return math.inf if math.isinf(fastest) else fastest * max(0.0, time_s - since_s)

    def _apart(self, value: float, time_s: float) -> _Fault | None:
        """Contradiction by more than half of the neighbours, and at least two.

        A neighbour that is not believed has no voice.
        """
        memory = self._memory
        others = [
            memory.shown[j]
            for j in self._neighbours
            if memory.doubt[j] <= _LOST and time_s - memory.shown_s[j] < _OLD_S
        ]
        far = sum(abs(other - value) > self._limits.apart for other in others)
        if 2 * far <= len(others) or far < _MIN_NEIGHBOURS:
            return None
        away = value - float(np.median(others))
        return _Fault(
            Doubt.APART,
            away,
            f"{value:g} {self._unit}, {away:+.3g} from its neighbours, allowed {self._limits.apart:g}",
        )
