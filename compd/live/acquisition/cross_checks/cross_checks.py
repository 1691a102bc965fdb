"""All votes of a machine. They look at the gauges ten times a second, in parallel to the lines' threads."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import structlog

from compd.arrays import FloatArray
from compd.live.acquisition.cross_checks.following_error import FollowingError
from compd.live.acquisition.cross_checks.machine_view import Contradiction, MachineView, Remark, Vote, WiredLength
from compd.live.acquisition.cross_checks.signal_periods import SignalPeriods
from compd.live.acquisition.cross_checks.standing_scale import StandingScale
from compd.live.memory import Latest, TrustMemory
from compd.operation_settings import FrameVote, VoteSettings
from compd.stated_noise import SCATTER_RATIO
from compd.units import UM_PER_MM

# Shortest time (s) over which a speed is taken; below it the times of readings make it uncertain.
_MIN_S = 0.05
# Longest interval (s) of setpoints; beyond it the tip's path is unknown.
_MAX_S = 1.0


class TipSpeed:
    """CMM mode: a scale is wrong if the tip would move faster than the machine can.

    Compares the tips of setpoints; names the scale that has moved most.
    """

    def __init__(self, largest_mm_per_s: float) -> None:
        self._largest_mm_per_s = largest_mm_per_s
        self._last: tuple[float, FloatArray, FloatArray] | None = None
        self._oldest_s = math.nan  # of the scales' readings at the last look

    def look(self, view: MachineView) -> Iterator[Contradiction]:
        setpoint = view.setpoint
        if setpoint is None or setpoint["mode"] != "cmm" or not setpoint["valid"]:
            self._last = None
            return
        scales = view.of_kind("scale")
        now = (float(setpoint["time_s"]), np.array(setpoint["tip_M_mm"]), view.value.copy())
        last = self._last
        if last is not None and now[0] - last[0] < _MIN_S:
            return
        self._last, before_s = now, self._oldest_s
        self._oldest_s = min(now[0], float(view.memory.time_s[scales].min()))
        if last is None or now[0] - last[0] > _MAX_S:
            return
        # the motion of a scale without readings for a while began at its last one
        speed = float(np.linalg.norm(now[1] - last[1])) / (now[0] - before_s)
        if speed > self._largest_mm_per_s:
            i = scales[int(np.argmax(np.abs(now[2] - last[2])[scales]))]
            yield Contradiction(i, f"the tip would move at {speed:.0f} mm/s, allowed {self._largest_mm_per_s:g} mm/s")


_MIN_OTHERS = 2


class StandingTemperature:
    """A thermometer is stuck if it repeats its digits while all others of the machine grow warmer, or colder.

    One in a body that changes slowly shows other digits, too: no two tenths of a degree in the time in which every
    other one changes by kelvins. Where its digits are too coarse for that, it has changed by less than one of them, and
    so little it is wrong.

    Remembers the values of all thermometers when each of them last changed its digits.
    """

    def __init__(self, changed_K: float) -> None:
        """`changed_K`: least change of all others, in the same direction."""
        self._changed_K = changed_K
        self._before: dict[int, tuple[float, FloatArray]] = {}  # number of its changes, and the values of all

    def look(self, view: MachineView) -> Iterator[Contradiction]:
        places = view.of_unit("degC")
        for i in places:
            changes = float(view.memory.changes[i])
            before = self._before.get(i)
            if before is None or before[0] != changes or not view.believed[i]:
                self._before[i] = changes, view.value.copy()
                continue
            others = [j for j in places if j != i and view.believed[j] and not np.isnan(before[1][j])]
            if len(others) < _MIN_OTHERS:
                continue
            risen_K = view.value[others] - before[1][others]
            if abs(risen_K.sum()) == np.abs(risen_K).sum() and np.abs(risen_K).min() >= self._changed_K:
                del self._before[i]
                yield Contradiction(
                    i, f"shows the same digits, while all others have changed by {np.abs(risen_K).min():.1f} K or more"
                )


# Equal readings that show a stuck gauge, also as multiples of the usual time between changes. Where a sample repeats
# the one before with a probability p, changes are 1 / (1 - p) samples apart, and a streak of 40 times as many comes
# with less than exp(-40) = 4e-18, whatever p is.
_STREAK = 40.0
# A gauge scatters if its last change is at most this many of its usual times ago.
_SCATTERING = 5.0
_MIN_CHANGES = 100


class RepeatedDigits:
    """A gauge is stuck if it repeats the same digits while others scatter.

    It can be told of gauges whose noise is not below their resolution: of these each new sample differs from the one
    before with a probability of 0.62 or more, wherever the value stands between two digits. A device that samples less
    often than it is asked gives each sample several times; so the time without a change is compared with the usual one
    between changes.

    Looks at how often each gauge has given the same digits.
    """

    def look(self, view: MachineView) -> Iterator[Contradiction]:
        memory = view.memory
        noise = np.array([wired.noise for wired in view.wired])
        n = len(view.wired)
        changes = memory.changes[:n]
        usual_s = (memory.last_change_s[:n] - memory.first_change_s[:n]) / np.maximum(changes - 1.0, 1.0)
        since_s = memory.shown_s[:n] - memory.last_change_s[:n]
        able = view.believed & (changes >= _MIN_CHANGES) & (noise >= memory.step_mm[:n])
        scatter = able & (since_s <= _SCATTERING * usual_s)
        if not scatter.any():
            return
        stuck = able & (since_s > _STREAK * usual_s) & (memory.repeats[:n] > _STREAK)
        for i in np.flatnonzero(stuck).tolist():
            repeats = int(memory.repeats[i])
            yield Contradiction(i, f"stuck: the same digits {repeats} times, while {scatter.sum()} others scatter")


# Ratio at which the warning of SCATTER_RATIO ends: smaller, so that the warning does not flicker.
_NEAR = 1.8


class MeasuredScatter:
    """Scatter of each length at rest against its declared noise: one of them is wrong if they differ by a factor of 2.

    A display with coarse digits scatters less than what it measures. So its smallest step counts as scatter, too,
    before a noise is said to be declared too large.

    Compares the scatter with the noise.
    """

    def __init__(self) -> None:
        self._outside: set[int] = set()

    def look(self, view: MachineView) -> Iterator[Remark]:
        for i, wired in enumerate(view.wired[: view.memory.lengths]):
            scatter_um = float(view.memory.scatter_mm[i]) * UM_PER_MM
            declared_um = wired.noise * UM_PER_MM
            if not math.isfinite(scatter_um) or not math.isfinite(declared_um):
                self._outside.discard(i)
                continue
            ratio = _NEAR if i in self._outside else SCATTER_RATIO
            step_um = float(view.memory.step_mm[i]) * UM_PER_MM
            # standard deviation of a uniform distribution between two digits: 0.29 of their distance
            at_most_um = math.hypot(scatter_um, step_um / math.sqrt(12))
            if scatter_um > ratio * declared_um or at_most_um < declared_um / ratio:
                self._outside.add(i)
                yield Remark(i, f"scatters by {scatter_um:.2g} um at rest, declared: {declared_um:g} um (`noise_um`)")
            else:
                self._outside.discard(i)


# Duration (s) of a difference that counts; longer than the interval of two polls of one unit.
LASTING_S = 0.5


class JointPair:
    """The two ball shanks of one revolute joint move together, but for the play of its axis.

    Compares Ra with Rb at each link; names the one that has moved further if they differ.
    """

    def __init__(self, largest_um: float) -> None:
        self._largest_um = largest_um
        self._since_s: dict[int, float] = {}

    def look(self, view: MachineView) -> Iterator[Contradiction]:
        role = {(wired.link, wired.role): i for i, wired in enumerate(view.wired) if wired.kind == "joint"}
        for (link, name), a in role.items():
            b = role.get((link, "Rb"))
            if name != "Ra" or b is None:
                continue
            apart_um = float(view.change[a] - view.change[b]) * UM_PER_MM
            if not (view.believed[a] and view.believed[b]) or not abs(apart_um) > self._largest_um:
                self._since_s.pop(link, None)
            elif view.now_s - self._since_s.setdefault(link, view.now_s) >= LASTING_S:
                del self._since_s[link]
                further, other = (a, b) if abs(view.change[a]) >= abs(view.change[b]) else (b, a)
                yield Contradiction(
                    further,
                    f"is {abs(apart_um):.1f} um from {view.wired[other].meaning} at the same joint, allowed "
                    f"{self._largest_um:g} um",
                )


class FrameTemperature:
    """The frame grows with its temperature: a comparator that says otherwise drifts, or the frame has been hit.

    Compares each frame distance with its thermal change since its first reading.
    """

    def __init__(self, settings: FrameVote) -> None:
        self._settings = settings
        self._start: dict[int, tuple[float, float]] = {}

    def look(self, view: MachineView) -> Iterator[Contradiction]:
        settings = self._settings
        temperature = view.quantities.get(settings.temperature)
        if temperature is None:
            return
        for i in view.of_kind("frame"):
            if not view.believed[i]:
                self._start.pop(i, None)
                continue
            wired = view.wired[i]
            value_mm, degC = self._start.setdefault(i, (float(view.value[i]), temperature))
            grown_um = wired.sign * (float(view.value[i]) - value_mm) * UM_PER_MM
            expected_um = settings.expansion_ppm_per_K * 1e-6 * (temperature - degC) * wired.length_mm * UM_PER_MM
            if abs(grown_um - expected_um) > settings.tolerance_um:
                del self._start[i]
                yield Contradiction(
                    i,
                    f"has moved by {grown_um:+.1f} um, {settings.temperature} explains {expected_um:+.1f} um, allowed "
                    f"{settings.tolerance_um:g} um apart",
                )


# Interval (s) of looks.
LOOK_EVERY_S = 0.1

log = structlog.get_logger()


class Votes:
    """Looks at the gauges, and names in `TrustMemory` those that others contradict."""

    def __init__(
        self,
        settings: VoteSettings,
        memory: TrustMemory,
        wired: Sequence[WiredLength],
        quantities: Mapping[str, tuple[str, float]],
        latest: Latest,
        zero_mm: Callable[[], Mapping[str, float] | None],
        setpoint_line: Callable[[], bytes | None],
        signal_period_mm: float = math.nan,
    ) -> None:
        """`wired`: what each channel of `memory` measures. `quantities`: channel and stale limit (s) of each quantity,
        by name. `zero_mm`: readings at machine zero by channel, or None. `setpoint_line`: the newest SETPOINT.
        `signal_period_mm`: of the scales, where it is known."""
        self._memory = memory
        self._wired = tuple(wired)
        self._sign = np.array([entry.sign for entry in self._wired], dtype=float)
        self._quantities = quantities
        self._latest = latest
        self._zero_mm = zero_mm
        self._setpoint_line = setpoint_line
        self._votes = _votes(settings, signal_period_mm)
        self._remarks: dict[str, str] = memory.warnings.read() or {}  # as left by the previous process
        for i in range(len(self._wired)):
            memory.suspected[i] = False  # votes of an ended acquisition: their evidence is gone
        # the messages are parsed only for votes that look at them
        self._needs_setpoint = (
            settings.following_mm is not None
            or settings.tip_mm_per_s is not None
            or (settings.signal_periods and not math.isnan(signal_period_mm))
        )

    def look(self, now_s: float) -> None:
        """Look once, at `now_s` (s)."""
        view = self._view(now_s)
        evidence: dict[str, str] = {}
        remarks: dict[str, str] = {}
        for vote in self._votes:
            for found in vote.look(view):
                channel = self._memory.channels[found.channel]
                if isinstance(found, Remark):
                    remarks[channel] = f"{remarks[channel]}; {found.text}" if channel in remarks else found.text
                else:
                    evidence.setdefault(channel, found.evidence)
        self._remark(remarks)
        if evidence:
            for channel, text in evidence.items():
                log.warning("gauge is contradicted", channel=channel, evidence=text)
            self._memory.vote(evidence)

    def _remark(self, remarks: dict[str, str]) -> None:
        """Publish what is to be looked at, and log what begins and what is over."""
        if remarks == self._remarks:
            return
        for channel in remarks.keys() - self._remarks.keys():
            log.warning("gauge is to be inspected", channel=channel, reason=remarks[channel])
        for channel in self._remarks.keys() - remarks.keys():
            log.info("gauge has no warning any more", channel=channel, reason=self._remarks[channel])
        self._remarks = remarks
        self._memory.warnings.write(remarks)

    def _view(self, now_s: float) -> MachineView:
        memory, n = self._memory, len(self._wired)
        value = memory.value[:n].copy()
        zero = self._zero_mm()
        zero_mm = np.array([math.nan if zero is None else zero.get(channel, math.nan) for channel in memory.channels])
        readings = self._latest.snapshot(now_s).readings
        quantities = {}
        for name, (channel, stale_after_s) in self._quantities.items():
            reading = readings[self._latest.index[channel]]
            if reading.ok and now_s - reading.time_s <= stale_after_s:
                quantities[name] = reading.value
        believed = memory.undoubted[:n] & ~np.isnan(value)
        change = self._sign * (value - zero_mm)
        return MachineView(now_s, memory, self._wired, value, believed, change, quantities, self._setpoint())

    def _setpoint(self) -> Mapping[str, Any] | None:
        line = self._setpoint_line() if self._needs_setpoint else None
        return None if not line else json.loads(line)


def _votes(settings: VoteSettings, signal_period_mm: float) -> list[Vote]:
    votes: list[Vote] = [MeasuredScatter()]
    if settings.signal_periods and not math.isnan(signal_period_mm):
        votes.append(SignalPeriods(signal_period_mm))
    if settings.repeated_digits:
        votes.append(RepeatedDigits())
    if settings.standing_scale_mm is not None:
        votes.append(StandingScale(settings.standing_scale_mm))
    if settings.standing_temperature_K is not None:
        votes.append(StandingTemperature(settings.standing_temperature_K))
    if settings.following_mm is not None:
        votes.append(FollowingError(settings.following_mm))
    if settings.joint_pair_um is not None:
        votes.append(JointPair(settings.joint_pair_um))
    if settings.tip_mm_per_s is not None:
        votes.append(TipSpeed(settings.tip_mm_per_s))
    if settings.frame is not None:
        votes.append(FrameTemperature(settings.frame))
    return votes
