"""Plausibility check of one length channel: no jumps, and the same value after an absence.

A reading that is not where the last ones lead is asked for once more. If the second answer is where they lead, the
first one was damaged. If it agrees with the first, the measured part has moved, where its acceleration and speed allow
that; else the gauge has jumped, and is not believed before a person accepts it.

A gauge was away if a poll has failed and it was not read for as long as its device takes to restart. It may count anew.
It is believed where it shows what it showed before and no other gauge has moved meanwhile; else a person accepts it.
The limits of motion judge a shorter gap, and one in which no poll has failed: the daemon itself was silent then. One
that is absolute, or goes on counting while its cable is out, is believed at once.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from compd.gauge import Quality, Reading, bad
from compd.live.acquisition.motion_before import MotionBefore
from compd.live.acquisition.motion_estimate import MAX_WINDOW_S, MotionEstimate
from compd.live.acquisition.motion_while_away import moved_while_away, scales_stood, stood_still
from compd.live.acquisition.possible_motion import (
    WINDOW_S,
    GaugeSample,
    MotionLimits,
    is_possible,
    mean_speed,
    rest_to_rest_mm,
)
from compd.live.acquisition.scatter import LatestScatter, RestScatter
from compd.live.acquisition.steps import Steps
from compd.live.acquisition.way_evidence import way_by_itself, way_by_links
from compd.live.memory import Doubt, TrustMemory

# Change (tolerances) of a gauge that was away for a moment which is no other count.
MIN_MOTION = 10.0
# Longest time (s) without an answer in which a part at rest may move unnoticed: with 300 mm/s2 by less than 1 mm.
MIN_GAP_S = 0.1
# Longest wait (s) after a gap for what others say: somewhat longer than the path of `way_evidence` takes.
WAIT_FOR_OTHERS_S = 0.1
# Smallest step (signal periods): an interpolator that loses counts loses whole periods or quarters of them.
MIN_PERIODS = 0.25
# Two answers agree if they differ by less than this share of the jump that they show.
_AGREEMENT = 0.2
# Answers of two polls, and of three, in which hum and noise hardly look like one motion.
_SOME, _MANY = 4, 6
# Largest ratio of the speeds of two successive polls, without a limit of acceleration.
_SPEED_RATIO = 5.0
# Flicker of a display at rest, in last digits.
_DIGITS = 2.0


@dataclass(frozen=True)
class TrustSettings:
    """Degree of trust in the readings of a channel.

    limits : what the measured part can do. returns_by_itself : the device shows the same value again when it is back.
    stale_after_s : age from which a last reading is lost. restart_s : shortest time in which the device restarts.
    signal_period_mm : of a scale, where it is known; nan.
    noise_mm : by more than that two readings of the same value do not differ by noise, mm; inf where none is stated.
    """

    limits: MotionLimits
    returns_by_itself: bool
    stale_after_s: float
    restart_s: float
    signal_period_mm: float = math.nan
    noise_mm: float = math.inf


class ReadingTrust:
    """Judges the readings of one channel; used by its line's thread."""

    def __init__(self, memory: TrustMemory, channel: str, settings: TrustSettings) -> None:
        self._memory = memory
        self._i = memory.index[channel]
        self._tolerance_mm = float(memory.tolerance_mm[self._i])
        self._settings = settings
        memory.returns[self._i] = settings.returns_by_itself
        self._before = MotionBefore(self._tolerance_mm, settings.limits)
        self._candidate: GaugeSample | None = None  # the last answer before any reading is believed
        self._back_s = math.nan  # time at which an absent gauge answered again
        self._missed = False  # whether a poll has failed since its last reading
        self._after: list[GaugeSample] = []  # its value since a gap, waiting for evidence
        self._unexplained: deque[GaugeSample] = deque(maxlen=_MANY)  # answers since its last reading
        self._scatter = RestScatter(self._tolerance_mm)
        self._latest = LatestScatter(self._tolerance_mm)
        self._motion = MotionEstimate(self._tolerance_mm)
        period_mm = settings.signal_period_mm
        least_mm = MIN_PERIODS * period_mm - self._tolerance_mm
        self._steps = None if math.isnan(period_mm) else Steps(least_mm, self._tolerance_mm)

    def surprises(self, sample: GaugeSample) -> bool:
        """Whether a second answer is needed, for a good reading outside its predicted range or a first one."""
        memory, i = self._memory, self._i
        if memory.accepted[i] != memory.obeyed[i]:
            return True
        doubt = memory.doubt_of(i)
        if doubt.until_accepted:
            return False
        return (
            doubt is Doubt.LOST
            or not self._recall()
            or not self._before.expects(sample)
            or self._needs_evidence(sample)
            or bool(self._unexplained)
        )

    def fail(self, quality: Quality, now_s: float) -> None:
        """Note a poll without a value, at `now_s` (s)."""
        memory, i = self._memory, self._i
        self._missed = True
        self._after.clear()
        self._unexplained.clear()
        self._lose_if_away(now_s)
        if quality is Quality.LINE_LOST or now_s - memory.shown_s[i] > self._settings.stale_after_s:
            memory.end_order(i)

    def _lose_if_away(self, now_s: float) -> None:
        """Note that the gauge is away, and may have restarted, where it has not answered for long enough."""
        memory, i, settings = self._memory, self._i, self._settings
        if self._missed and now_s - memory.time_s[i] > max(settings.stale_after_s, settings.restart_s):
            memory.lose(i, now_s, power=True)

    def show(self, reading: Reading) -> None:
        """Let other channels compare themselves with a good reading, be it believed or not."""
        self._memory.show(self._i, reading.value, reading.time_s)

    def judge(self, reading: Reading, window_s: float, first: Reading | None = None) -> Reading:
        """The reading to publish: itself, the first answer, or one without a value.

        Parameters
        ----------
        reading : good, and the last answer of the poll.
        window_s : by how much the sample may be later than the reading's time, s.
        first : the first answer of a poll that was asked twice, where that is good too.
        """
        memory, i = self._memory, self._i
        sample = GaugeSample(reading.value, reading.time_s, window_s)
        self.show(reading)
        self._scatter.note(sample)
        memory.scatter_mm[i] = self._scatter.mm
        # a channel accepted during a poll is polled twice the next time
        if memory.accepted[i] != memory.obeyed[i] and first is not None:
            begun = self._begin(reading, sample, first)
            if begun.ok or memory.suspected[i]:
                memory.end_order(i)
                memory.handled[i] = memory.voted[i]
            return begun
        if memory.voted[i] != memory.handled[i]:
            memory.handled[i] = memory.voted[i]
            memory.distrust(i, Doubt.VOTED, math.nan)
        self._lose_if_away(self._after[0].time_s if self._after else sample.time_s)
        doubt = memory.doubt_of(i)
        if doubt.until_accepted:
            return self._reject(reading)
        if doubt is Doubt.LOST:
            return self._judge_after_absence(reading, sample, first)
        if not self._recall():
            return self._begin(reading, sample, first)
        return self._judge_continuing(reading, sample, first)

    def _recall(self) -> bool:
        """Whether the next reading has a predecessor, in this process or another one."""
        if not self._before.history:
            recent = self._memory.recent(self._i)
            self._before.history.extend(GaugeSample(float(value), float(time_s), WINDOW_S) for time_s, value in recent)
        return bool(self._before.history)

    def _begin(self, reading: Reading, sample: GaugeSample, first: Reading | None) -> Reading:
        """Believe a reading without regard to earlier ones if two answers agree."""
        if first is None:
            return bad(reading.time_s, Quality.MISMATCH, f"{sample.value:.4f} mm is not confirmed by a second answer")
        earlier = GaugeSample(first.value, first.time_s, sample.window_s)
        before, self._candidate = self._candidate, None
        if abs(sample.value - earlier.value) > self._tolerance_mm and not (
            before is not None and self._goes_on(before, earlier, sample)
        ):
            self._candidate = sample  # for a moving part the next poll shows more
            return bad(
                reading.time_s, Quality.MISMATCH, f"two answers disagree: {first.value:.4f}, {sample.value:.4f} mm"
            )
        self._before.history.clear()
        self._memory.begin(self._i)
        if earlier.time_s < sample.time_s:  # two samples tell how it moves; a latched gauge answers with one
            self._remember(earlier)
        return self._accept(reading, sample)

    def _accept(self, reading: Reading, sample: GaugeSample) -> Reading:
        self._missed = False
        self._after.clear()
        self._unexplained.clear()
        self._latest.note(sample.value, self._unexplained_mm(sample))
        self._remember(sample)
        self._memory.believe(self._i, sample.value, sample.time_s)
        motion = self._motion.note(self._before.history, self._scatter_mm())
        if self._memory.suspected[self._i]:
            return bad(reading.time_s, Quality.STALE, "stands while all others move")
        return Reading(reading.value, reading.time_s, reading.quality, reading.detail, motion)

    def _scatter_mm(self) -> float:
        """The larger scatter of windows of readings and of the last few; nan if neither shows one."""
        known = [mm for mm in (self._scatter.mm, self._latest.mm) if not math.isnan(mm)]
        return max(known, default=math.nan)

    def _unexplained_mm(self, sample: GaugeSample) -> float:
        """Change (mm) of a joint or the frame at rest; 0 within its noise, and over times of possible drift."""
        memory, i = self._memory, self._i
        if i < memory.scales or not self._before.history or sample.time_s - memory.time_s[i] > MAX_WINDOW_S:
            return 0.0
        change_mm = abs(sample.value - float(memory.value[i]))
        within_mm = max(self._settings.noise_mm, _DIGITS * float(memory.step_mm[i]))
        return change_mm if change_mm > min(within_mm, self._tolerance_mm) and scales_stood(memory, i) else 0.0

    def _remember(self, sample: GaugeSample) -> None:
        """Keep a sample of motion, and count the step that it completes."""
        self._before.history.append(sample)
        step = None if self._steps is None else self._steps.note(sample)
        if step is not None:
            memory, i = self._memory, self._i
            memory.stepped_mm[i] += 0.0 if step.is_seen else step.height_mm
            memory.stepped_s[i] = step.time_s
            memory.stepped[i] += 1  # last: it marks the others as complete

    def _reject(self, reading: Reading) -> Reading:
        limits = self._limits_text() if self._memory.doubt_of(self._i) is Doubt.JUMPED else ""
        return bad(reading.time_s, Quality.DISTRUSTED, self._memory.explanation(self._i) + limits)

    def _judge_after_absence(self, reading: Reading, sample: GaugeSample, first: Reading | None) -> Reading:
        """The first readings of a gauge that was away."""
        memory, i = self._memory, self._i
        if not self._back_s >= memory.lost_s[i]:
            self._back_s = sample.time_s
        if self._settings.returns_by_itself or math.isnan(memory.value[i]):
            return self._begin(reading, sample, first)
        away_mm = sample.value - float(memory.value[i])
        if first is None:
            return bad(reading.time_s, Quality.MISMATCH, f"{sample.value:.4f} mm is not confirmed by a second answer")
        if abs(first.value - sample.value) > self._tolerance_mm:
            return bad(
                reading.time_s, Quality.MISMATCH, f"two answers disagree: {first.value:.4f}, {sample.value:.4f} mm"
            )
        if abs(away_mm) > self._tolerance_mm:
            return self._returned(reading, away_mm)
        absence = moved_while_away(memory, i, self._back_s, sample.time_s)
        if not absence.compared:
            return bad(reading.time_s, Quality.STALE, "is back; the other gauges are not yet")
        if absence.moved is not None:
            memory.distrust(i, Doubt.MOVED_MEANWHILE, absence.moved)
            return self._reject(reading)
        if not absence.witnessed:
            memory.distrust(i, Doubt.UNWITNESSED, math.nan)
            return self._reject(reading)
        if memory.power_lost[i] and i < memory.scales and abs(sample.value) <= self._tolerance_mm:
            memory.distrust(i, Doubt.AT_ZERO, 0.0)
            return self._reject(reading)
        return self._begin(reading, sample, first)

    def _judge_continuing(self, reading: Reading, sample: GaugeSample, first: Reading | None) -> Reading:
        """A reading with predecessors, of a gauge without an absence.

        The second answer of a gauge that was latched is the same sample once more: it says whether the first one was
        damaged, and nothing of motion.
        """
        earlier = None if first is None else GaugeSample(first.value, first.time_s, sample.window_s)
        latched = earlier is not None and earlier.time_s == sample.time_s
        needs_evidence = self._needs_evidence(sample)
        before = [*self._unexplained]
        self._unexplained += [sample] if earlier is None or latched else [earlier, sample]
        jumped = self._is_a_motion_from_elsewhere()
        if not jumped:
            others = before if earlier is None else [*before, earlier]
            if self._before.expects(sample, others) and not needs_evidence:
                return self._accept(reading, sample)
        if first is None or earlier is None:
            return bad(reading.time_s, Quality.MISMATCH, f"{sample.value:.4f} mm is not confirmed by a second answer")
        if not jumped and self._before.expects(earlier, [*before, sample]) and not self._needs_evidence(earlier):
            return self._accept(first, earlier)
        if abs(sample.value - earlier.value) > self._tolerance_mm:  # one answer may be damaged; two are not
            self._latest.note(earlier.value)
        last, limits = self._before.last, self._settings.limits
        stays = len(self._unexplained) >= _MANY if jumped else self._stays(earlier, sample)
        possible = not jumped and self._is_possible(earlier, sample, latched)
        if possible and (stays or math.isfinite(limits.acceleration) or self._goes_on(last, earlier, sample)):
            if needs_evidence:
                return self._compared(reading, earlier, sample)
            if not latched:
                self._remember(earlier)
            return self._accept(reading, sample)
        if stays:
            jumped_mm = self._before.off_mm(sample, self._before.lasting_mm_per_s)
            self._memory.distrust(self._i, Doubt.JUMPED, jumped_mm)
            return self._reject(reading)
        self._latest.note(sample.value)
        values = ", ".join(f"{value:.4f}" for value in (last.value, earlier.value, sample.value))
        return bad(reading.time_s, Quality.MISMATCH, f"no two of three values agree: {values} mm{self._limits_text()}")

    def _is_possible(self, earlier: GaugeSample, sample: GaugeSample, latched: bool) -> bool:
        """Whether the part can have come from the last reading over one answer to the other."""
        last, limits = self._before.last, self._settings.limits
        if not latched and self._before.rested and abs(sample.value - earlier.value) <= self._tolerance_mm:
            duration_s = earlier.time_s + earlier.window_s - last.time_s
            return abs(earlier.value - last.value) <= rest_to_rest_mm(limits, duration_s, self._tolerance_mm)
        return is_possible([last, earlier, sample], self._tolerance_mm, limits, *self._before.speed())

    def _is_a_motion_from_elsewhere(self) -> bool:
        """Whether the answers that were not believed are one motion, which cannot have come from the last reading.

        The more time has passed since that, the more is possible without them. Noise below what the acceleration makes
        from one answer to the next is no jump.
        """
        before, limits, samples = self._before, self._settings.limits, self._unexplained
        if math.isinf(limits.acceleration) or len(samples) < _SOME:
            return False
        passed_s = samples[0].time_s - before.last.time_s
        if abs(before.off_mm(samples[0], before.lasting_mm_per_s)) <= limits.acceleration * passed_s**2:
            return False
        if not is_possible(samples, self._tolerance_mm, limits):
            return False
        return not is_possible([before.last, *samples], self._tolerance_mm, limits, *before.speed())

    def _stays(self, earlier: GaugeSample, sample: GaugeSample) -> bool:
        """Whether the second answer confirms the first one: the part stands there, or goes on as fast as before."""
        before = self._before
        for mm_per_s in (0.0, before.lasting_mm_per_s):
            jump_mm = before.off_mm(earlier, mm_per_s)
            if abs(before.off_mm(sample, mm_per_s) - jump_mm) <= self._tolerance_mm + _AGREEMENT * abs(jump_mm):
                return True
        return False

    def _limits_text(self) -> str:
        """Keys of the gauge that limit its motion; too small a limit makes motion look like jumps."""
        limits = self._settings.limits
        set_to = {"fastest_mm_per_s": limits.speed, "acceleration_mm_per_s2": limits.acceleration}
        keys = ", ".join(f"`{key}: {limit:g}`" for key, limit in set_to.items() if math.isfinite(limit))
        return f"; its motion is limited by {keys}" if keys else ""

    def _needs_evidence(self, sample: GaugeSample) -> bool:
        """Whether a gauge that was not read for a while shows another value, by which it may have lost its count."""
        gap_s = sample.time_s - self._before.last.time_s
        change_mm = abs(sample.value - self._before.last.value)
        if self._settings.returns_by_itself or change_mm <= MIN_MOTION * self._tolerance_mm:
            return False
        return bool(self._after) or (gap_s > MIN_GAP_S and (self._missed or self._before.rested))

    def _compared(self, reading: Reading, earlier: GaugeSample, sample: GaugeSample) -> Reading:
        """A possible value after a gap: believed unless others contradict it, or its device had time to restart.

        A part that rested before has not moved where the other scales still stand. On the move, the ways of the other
        links say how far a scale went, or its own speed does; its limits of motion where neither is known.
        """
        memory, i = self._memory, self._i
        after, last = self._after, self._before.last
        after += [later for later in (earlier, sample) if not after or later.time_s > after[-1].time_s]
        way_mm, waited_s = after[0].value - last.value, sample.time_s - after[0].time_s
        if self._missed and after[0].time_s - last.time_s > self._settings.restart_s:
            return self._returned(reading, way_mm)
        if self._before.rested:
            stood = stood_still(memory, i, after[0].time_s)
            if stood:
                return self._returned(reading, way_mm)
            waits = stood is None
        elif i < memory.scales:
            by_links, by_itself = (
                way_by_links(memory, i, self._before.history, after),
                way_by_itself(self._before.history, after),
            )
            explained = any(way is not None and way.explains(way_mm) for way in (by_links, by_itself))
            waits = not explained and by_links is None
            expected = by_links or (by_itself if waited_s >= WAIT_FOR_OTHERS_S else None)
            if expected is not None and not explained:
                return self._returned(reading, way_mm - expected.way_mm)
        else:
            waits = False
        if waits and waited_s < WAIT_FOR_OTHERS_S:
            return bad(reading.time_s, Quality.MISMATCH, "has moved in a gap; the others do not show yet how far")
        for later in after:
            if later.time_s < sample.time_s:
                self._remember(later)
        return self._accept(reading, sample)

    def _returned(self, reading: Reading, away_mm: float) -> Reading:
        self._memory.distrust(self._i, Doubt.RETURNED, away_mm)
        return self._reject(reading)

    def _goes_on(self, last: GaugeSample, first: GaugeSample, second: GaugeSample) -> bool:
        """Whether the second answer continues the motion that the first one shows; without a limit of acceleration."""
        then = mean_speed(first, second, self._tolerance_mm)
        now = mean_speed(last, first, self._tolerance_mm)
        sign = math.copysign(1.0, first.value - last.value)
        slowest, fastest = sorted((sign * now.low / _SPEED_RATIO, sign * now.high * _SPEED_RATIO))
        low, high = sorted((sign * then.low, sign * then.high))
        return max(low, slowest) <= min(high, fastest)
