"""All votes of a machine. They look at the gauges ten times a second, in parallel to the lines' threads."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import structlog

from compd.live.acquisition.cross_checks.following_error import FollowingError
from compd.live.acquisition.cross_checks.frame_temperature import FrameTemperature
from compd.live.acquisition.cross_checks.joint_pair import JointPair
from compd.live.acquisition.cross_checks.machine_view import MachineView, Remark, Vote, WiredLength
from compd.live.acquisition.cross_checks.measured_scatter import MeasuredScatter
from compd.live.acquisition.cross_checks.repeated_digits import RepeatedDigits
from compd.live.acquisition.cross_checks.signal_periods import SignalPeriods
from compd.live.acquisition.cross_checks.standing_scale import StandingScale
from compd.live.acquisition.cross_checks.standing_temperature import StandingTemperature
from compd.live.acquisition.cross_checks.tip_speed import TipSpeed
from compd.live.memory import Doubt, Latest, TrustMemory
from compd.operation_settings import VoteSettings

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
        believed = (memory.doubt[:n] == Doubt.NONE) & ~np.isnan(value)
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
