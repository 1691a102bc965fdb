"""Motion along a stream of commands, as a controller gives them to its drives."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.simulation.truth.motion import Phase

# The drives are this much behind their commands, s: the stream's pieces come in bursts, and the motion has none.
DELAY_S = 0.05
# Slower links count as standing: a correction creeps all the time.
STANDING_MM_PER_S = 0.02


class MotorCommand(NamedTuple):
    """Where the links are to be, (n,) mm, and how long ago the controller said so, s."""

    age_s: float
    scale_mm: FloatArray


class FollowMotion:
    """The links go where a controller commands them, in a straight line from one command to the next.

    There is no limit of speed: that is the controller's matter, and a jump of its commands must be seen as one.
    """

    point = None

    def __init__(self, start_mm: FloatArray) -> None:
        """start_mm : (n,) where the links stand until the first command."""
        self._now_s = 0.0
        # the commands that are not yet reached, and the last one that was
        self._ahead: deque[tuple[float, FloatArray]] = deque()
        self._behind: tuple[float, FloatArray] = (0.0, start_mm)

    def follow(self, commands: Sequence[MotorCommand]) -> None:
        """Append commands, oldest first. One that is older than its predecessor is left out."""
        last_s = self._ahead[-1][0] if self._ahead else self._behind[0]
        for command in commands:
            due_s = self._now_s - command.age_s + DELAY_S
            if due_s > last_s:
                self._ahead.append((due_s, command.scale_mm))
                last_s = due_s

    @property
    def position_mm(self) -> FloatArray:
        """(n,) scale positions."""
        if not self._ahead:
            return self._behind[1]
        (start_s, start_mm), (end_s, end_mm) = self._behind, self._ahead[0]
        share = (self._now_s - start_s) / (end_s - start_s)
        return start_mm + share * (end_mm - start_mm)

    @property
    def speeds_mm_per_s(self) -> FloatArray:
        """(n,) speeds."""
        if not self._ahead:
            return np.zeros_like(self._behind[1])
        (start_s, start_mm), (end_s, end_mm) = self._behind, self._ahead[0]
        return (end_mm - start_mm) / (end_s - start_s)

    @property
    def phase(self) -> Phase:
        return "moving" if float(np.abs(self.speeds_mm_per_s).max()) > STANDING_MM_PER_S else "dwelling"

    def advance(self, time_s: float) -> float:
        """Advance by `time_s`; returns how many seconds of it the links moved."""
        self._now_s += time_s
        moved = self.phase == "moving"
        while self._ahead and self._ahead[0][0] <= self._now_s:
            self._behind = self._ahead.popleft()
            moved = moved or self.phase == "moving"
        if not self._ahead:
            # the stream has a gap: what comes next goes on from here and now
            self._behind = (self._now_s, self._behind[1])
        return time_s if moved else 0.0
