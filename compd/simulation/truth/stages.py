"""What a machine does to measure a plan's rows: moves and waits, one after the other, for whoever lets time pass."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.simulation.truth.heat import HELD_TIME_CONSTANT_S
from compd.simulation.truth.motion import Move
from compd.simulation.truth.planned_row import PlannedRow

# After so long a part that was 10 K away from where it is held has come within 0.01 K of it.
SETTLED_S = 7 * HELD_TIME_CONSTANT_S
# At rest at a row: every gauge is read, and a tracker has looked many times.
DWELL_S = 1.5

# At the points of a walk, in turn: motion with a pattern, so that two clocks that saw it can be laid over each other.
WALK_DWELLS_S = (0.2, 0.9, 0.4, 0.7)

Purpose = Literal["walk", "way", "settle", "wait", "look"]
Hold = Callable[[Mapping[str, float]], None]


class Stage(NamedTuple):
    """The links follow `move` and rest until `duration_s` is over; `look`: this is where the row is measured.

    row : the one that is measured here or next.
    """

    row: PlannedRow
    purpose: Purpose
    move: Move
    duration_s: float


def stages(
    rows: Sequence[PlannedRow],
    start_mm: FloatArray,
    hold: Hold,
    speedup: float = 1.0,
    walk_mm: Sequence[FloatArray] = (),
) -> Iterator[Stage]:
    """All of them in order. start_mm : (n,) where the links are.

    hold : called with a row's quantities when the machine sets out for it. speedup : a plan's waiting, and the
    warming up of its parts, take so many times less. walk_mm : points (n,) to visit first.
    """
    here_mm, direction = start_mm, np.ones_like(start_mm)
    now_s = began_s = 0.0
    held_degC: dict[str, float] = {}
    for number, point_mm in enumerate(walk_mm):
        move = Move(here_mm, point_mm)
        direction = np.where(point_mm != here_mm, np.sign(point_mm - here_mm), direction)
        here_mm = point_mm
        yield Stage(rows[0], "walk", move, move.duration_s + WALK_DWELLS_S[number % len(WALK_DWELLS_S)])
    for row in rows:
        hold(row.quantities)
        settled_s = now_s + SETTLED_S / speedup if row.parts_degC != held_degC else now_s
        held_degC = row.parts_degC
        for end_mm in row.way_mm(here_mm, direction):
            move = Move(here_mm, end_mm)
            moved = end_mm - here_mm
            direction = np.where(moved != 0, np.sign(moved), direction)
            here_mm, now_s = end_mm, now_s + move.duration_s
            if move.duration_s > 0:
                yield Stage(row, "way", move, move.duration_s)
        rest = Move(here_mm, here_mm)
        if settled_s > now_s:
            yield Stage(row, "settle", rest, settled_s - now_s)
            now_s = settled_s
        began_s = now_s if row.begins else began_s
        due_s = began_s + row.time_s / speedup
        if due_s > now_s:
            yield Stage(row, "wait", rest, due_s - now_s)
            now_s = due_s
        look = Move(here_mm, row.end_mm, row.speed_mm_per_s) if row.on_the_move else rest
        yield Stage(row, "look", look, look.duration_s + DWELL_S)
        direction = np.where(row.approach != 0, row.approach, direction)
        here_mm, now_s = row.end_mm, now_s + look.duration_s + DWELL_S


class Measuring:
    """The drives of a machine that goes through a plan's rows, one or more, and stands still after the last."""

    point = None

    def __init__(
        self,
        rows: Sequence[PlannedRow],
        start_mm: FloatArray,
        hold: Hold,
        speedup: float,
        walk_mm: Sequence[FloatArray],
    ) -> None:
        """As `stages`."""
        self._stages = stages(rows, start_mm, hold, speedup, walk_mm)
        self._stage: Stage | None = next(self._stages, None)
        self._since_s = 0.0
        self._rows = len(rows)
        self._row = rows[0]
        self.position_mm = start_mm

    @property
    def done(self) -> bool:
        return self._stage is None

    @property
    def phase(self) -> Literal["moving", "dwelling"]:
        return "moving" if self._stage and self._since_s < self._stage.move.duration_s else "dwelling"

    def advance(self, time_s: float) -> float:
        """Go on for `time_s`; for how much of it the links moved, s."""
        moved_s = 0.0
        while self._stage is not None:
            step_s = min(time_s, self._stage.duration_s - self._since_s)
            moved_s += max(0.0, min(step_s, self._stage.move.duration_s - self._since_s))
            self._since_s += step_s
            time_s -= step_s
            self.position_mm = self._stage.move.position_mm(self._since_s)
            if time_s <= 0:
                break
            self._stage, self._since_s = next(self._stages, None), 0.0
            self._row = self._stage.row if self._stage else self._row
        return moved_s

    def told(self) -> Mapping[str, Any]:
        """For TRUTH: which row of how many, what it is for, what happens there now, and whether all is done."""
        doing = self._stage.purpose if self._stage else "done"
        return {
            "row": self._row.number,
            "rows": self._rows,
            "purpose": self._row.purpose,
            "doing": doing,
            "done": self.done,
        }
