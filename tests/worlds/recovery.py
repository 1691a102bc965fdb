"""Setpoints are valid again within a time after the last fault; where a person is asked for, after a person came."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import yaml

from compd.setpoint_states import State
from tests.worlds.sight import Happening, Sight

FILE = Path(__file__).with_name("back_within.yaml")


class Allowed(NamedTuple):
    """within_s : from the end of a fault to a valid setpoint. person : whether a person may be asked for."""

    within_s: float
    person: bool


def allowed_times(path: Path = FILE) -> dict[str, Allowed]:
    """By kind, as "lines.cable"; "default" for all others."""
    return {name: Allowed(**row) for name, row in yaml.safe_load(path.read_text(encoding="utf-8")).items()}


class Recovery:
    """Follows one world from its last fault to its next valid setpoint."""

    def __init__(self, times: dict[str, Allowed] | None = None) -> None:
        self._times = times or allowed_times()
        self._awaited: list[Happening] = []
        self._accepted_s: float | None = None

    def begins(self, happening: Happening) -> None:
        """A fault begins."""
        if happening.is_fault:
            self._awaited.append(happening)
            self._accepted_s = None

    def accepted(self, now_s: float) -> None:
        """A person has looked. A second look after the end of the same faults gives no further time."""
        if self._accepted_s is None and not any(happening.fault.present for happening in self._awaited):
            self._accepted_s = now_s

    def late(self, sight: Sight) -> str:
        """What does not hold: no setpoint was valid for too long after the last fault has ended."""
        if not self._awaited or any(happening.fault.present for happening in self._awaited):
            return ""
        if sight.told.valid:
            self._awaited.clear()
            return ""
        rows = [self._times.get(one.event.name, self._times["default"]) for one in self._awaited]
        ended_s = max(happening.fault.ended_s for happening in self._awaited)
        if any(row.person for row in rows):
            if sight.told.state is State.NO_ZERO or (self._accepted_s is None and sight.told.state is State.FAULT):
                return ""  # the person is on the way
            ended_s = max(ended_s, self._accepted_s or 0.0)
        within_s = max(row.within_s for row in rows)
        if sight.told.time_s <= ended_s + within_s:
            return ""
        kinds = ", ".join(sorted({happening.event.name for happening in self._awaited}))
        self._awaited.clear()
        return f"not valid within {within_s:g} s after {kinds}: {sight.told.state}, {sight.told.reason[:200]}"
