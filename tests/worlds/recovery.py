"""Setpoints are valid again within a time after the last fault; where a person is asked for, after a person came.

The times are those of docs/reference/states.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from compd.configuration import Configuration
from compd.setpoint_states import State
from docs.generate.state_ends import PERSON, Cause, cause_of_silence, within_s
from tests.worlds.invariants import named_in
from tests.worlds.sight import Happening, Sight

# What the states come from after a fault of a kind; `Cause.WRONG` after all others.
CAUSES: Mapping[str, Sequence[Cause]] = {
    "replies.lost": [Cause.SILENT],
    "replies.silent": [Cause.SILENT],
    "lines.cable": [Cause.LINE],
    "lines.cables_of_scales": [Cause.LINE],
    "lines.gateway": [Cause.LINE],
    "lines.power": [Cause.SILENT, Cause.WRONG],
    "gauges.returns": [Cause.LINE, Cause.WRONG],
    "gauges.thermometer_jump": [Cause.QUANTITY],
    "computer.pause": [Cause.PAUSED],
    "computer.pause_in_motion": [Cause.PAUSED],
    # a process that sleeps for too long is killed
    "computer.pause_process": [Cause.PAUSED, Cause.ACQUISITION],
    "computer.wakes_late": [Cause.PAUSED],
    "computer.killed": [Cause.ACQUISITION],
    "computer.restart": [Cause.STARTED],
    "computer.reboot": [Cause.STARTED],
    "computer.torn_file": [Cause.STARTED, Cause.WRONG],
    "computer.clock_set": [Cause.LIMIT],
    "machine.moved_while_silent": [Cause.SILENT],
    "machine.pushed": [Cause.LINE, Cause.WRONG],
}


class Allowed(NamedTuple):
    """within_s : from the end of the last fault to a valid setpoint. person : whether a person may be asked for."""

    within_s: float
    person: bool


def allowed(configuration: Configuration, awaited: Sequence[Happening], moved: bool) -> Allowed:
    """What the reference allows after faults that follow each other.

    moved : whether the machine has moved since the first began.
    """
    lasted_s = max(one.fault.ended_s for one in awaited) - min(one.fault.began_s for one in awaited)
    longest_s, person = 0.0, False
    for one in awaited:
        gauges = [name for name in one.fault.targets or () if name in configuration.gauges]
        for cause in _causes(configuration, one, gauges, lasted_s):
            rests_s, moves_s = (within_s(configuration, cause, moving, gauges, lasted_s) for moving in (False, True))
            person = person or (moves_s if moved else rests_s) == PERSON
            # after a person came, gauges are read as after a start
            longest_s = max(longest_s, rests_s if math.isfinite(rests_s) else within_s(configuration, Cause.STARTED))
    return Allowed(longest_s, person)


def _causes(configuration: Configuration, one: Happening, gauges: Sequence[str], lasted_s: float) -> set[Cause]:
    causes = set(CAUSES.get(one.event.name, [Cause.WRONG]))
    if Cause.SILENT in causes:
        causes -= {Cause.SILENT}
        causes |= {cause_of_silence(configuration, gauge, lasted_s) for gauge in gauges}
    scales = {wire.gauge.partition(".")[0] for wire in configuration.wiring.scale}
    if causes & {Cause.SILENT, Cause.LINE} and scales <= {*(gauges or configuration.gauges)}:
        causes |= {Cause.ALL_SCALES}
    return causes


def asks_for_a_suspect(sight: Sight) -> bool:
    """Whether a person is asked to look at a gauge that had a fault before, which was not seen until now."""
    named = named_in(sight.told.reason, sight.configuration)
    return sight.told.state is State.FAULT and ("" in sight.suspects or bool(named & sight.suspects))


class Recovery:
    """Follows one world from its last fault to its next valid setpoint."""

    def __init__(self, allowed: Callable[[Configuration, Sequence[Happening], bool], Allowed] = allowed) -> None:
        self._allowed = allowed
        self._awaited: list[Happening] = []
        self._accepted_s: float | None = None
        self._moved = False
        self._known: tuple[tuple[int, bool], Allowed] | None = None

    def begins(self, happening: Happening) -> None:
        """A fault begins."""
        if happening.is_fault:
            self._moved = self._moved and bool(self._awaited)
            self._awaited.append(happening)
            self._accepted_s = None
            self._known = None

    def accepted(self, now_s: float) -> None:
        """A person has looked. A second look after the end of the same faults gives no further time."""
        if self._accepted_s is None and not any(happening.fault.present for happening in self._awaited):
            self._accepted_s = now_s

    def late(self, sight: Sight) -> str:
        """What does not hold: no setpoint was valid for too long after the last fault has ended."""
        self._moved = self._moved or sight.told.moving
        if not self._awaited or any(happening.fault.present for happening in self._awaited):
            return ""
        if sight.told.valid:
            self._awaited.clear()
            return ""
        within_s, person = self._allowed_now(sight.configuration)
        ended_s = max(happening.fault.ended_s for happening in self._awaited)
        if person or asks_for_a_suspect(sight):
            if sight.told.state is State.NO_ZERO or (self._accepted_s is None and sight.told.state is State.FAULT):
                return ""  # the person is on the way
            ended_s = max(ended_s, self._accepted_s or 0.0)
        if sight.told.time_s <= ended_s + within_s:
            return ""
        kinds = ", ".join(sorted({happening.event.name for happening in self._awaited}))
        self._awaited.clear()
        return f"not valid within {within_s:.3g} s after {kinds}: {sight.told.state}, {sight.told.reason[:200]}"

    def _allowed_now(self, configuration: Configuration) -> Allowed:
        """Of what is awaited, which has ended: it is asked with every setpoint, and changes with the motion alone."""
        key = len(self._awaited), self._moved
        if self._known is None or self._known[0] != key:
            self._known = key, self._allowed(configuration, self._awaited, self._moved)
        return self._known[1]
