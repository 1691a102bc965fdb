"""Motion along a stream of commands, as a controller gives them to its drives."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.simulation.truth.motion import Phase

# The drives are about this much behind their commands, s: the stream comes in bursts, and the motion has none.
DELAY_S = 0.1
# Factor of speed for catching up after a late stream, which slows the motion down.
CATCH_UP = 1.1
# Slower links count as standing: a correction creeps all the time.
STANDING_MM_PER_S = 0.02


class MotorCommand(NamedTuple):
    """Commanded link lengths, (n,) mm, at the time `time_s` of the controller's own clock."""

    time_s: float
    scale_mm: FloatArray


class FollowMotion:
    """Motion along a controller's commands, straight from one command to the next.

    There is no limit of speed: that is the controller's matter, and a jump of its commands must be seen as one. Only
    the stream's own pauses, which a wire to a drive does not have, are smoothed: time on the controller's clock passes
    more slowly when few commands are left.

    position_mm, speeds_mm_per_s : (n,) of the scales, now.
    """

    point = None

    def __init__(self, start_mm: FloatArray) -> None:
        """start_mm : (n,) positions of the links until the first command."""
        self.position_mm = start_mm
        self.speeds_mm_per_s: FloatArray = np.zeros_like(start_mm)
        self._time_s: float | None = None  # progress of the motion on the controller's clock
        self._before: MotorCommand | None = None
        self._ahead: deque[MotorCommand] = deque()

    def follow(self, commands: Sequence[MotorCommand]) -> None:
        """Append commands, oldest first. One that is older than its predecessor begins a new stream."""
        for command in commands:
            last = self._ahead[-1] if self._ahead else self._before
            if last is None or command.time_s < last.time_s:
                self._ahead.clear()
                self._before, self._time_s = command, command.time_s - DELAY_S
            self._ahead.append(command)

    @property
    def phase(self) -> Phase:
        return "moving" if float(np.abs(self.speeds_mm_per_s).max()) > STANDING_MM_PER_S else "dwelling"

    def advance(self, time_s: float) -> float:
        """Advance by `time_s`; returns how many seconds of it the links moved."""
        if self._before is None or self._time_s is None or time_s <= 0:
            return 0.0
        left_s = self._ahead[-1].time_s - self._time_s if self._ahead else 0.0
        rate = min(1.0, 2 * left_s / DELAY_S) if left_s < 1.5 * DELAY_S else CATCH_UP
        self._time_s += min(left_s, rate * time_s)
        while self._ahead and self._ahead[0].time_s <= self._time_s:
            self._before = self._ahead.popleft()
        here_mm = self._before.scale_mm
        if self._ahead and self._time_s > self._before.time_s:
            share = (self._time_s - self._before.time_s) / (self._ahead[0].time_s - self._before.time_s)
            here_mm = here_mm + share * (self._ahead[0].scale_mm - here_mm)
        self.speeds_mm_per_s, self.position_mm = (here_mm - self.position_mm) / time_s, here_mm
        return time_s if self.phase == "moving" else 0.0
