"""Motion of a machine that measures planned rows: a sequence of stages, each a move followed by a rest."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain
from typing import Any, Literal, NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.simulation.truth.heat import HELD_TIME_CONSTANT_S
from compd.simulation.truth.motion import Approach, Move
from compd.simulation.truth.planned_row import PlannedRow

# Time after which a part that was 10 K away from its held temperature is within 0.01 K of it.
SETTLED_S = 7 * HELD_TIME_CONSTANT_S
# Rest at a row: every gauge is read anew, and a tracker has measured many times.
DWELL_S = 1.5

# Dwell at the points of a walk, in turn: an irregular motion, so that two recordings of it can be aligned in time.
WALK_DWELLS_S = (0.2, 0.9, 0.4, 0.7)

Purpose = Literal["walk", "way", "settle", "wait", "look"]
Hold = Callable[[Mapping[str, float]], None]


class Stage(NamedTuple):
    """The links follow `move`, then rest until `duration_s` is over.

    row : the row that is measured in this stage (purpose "look") or next. purpose : "walk" to align clocks, "way" to a
    row, "settle" until held temperatures are reached, "wait" for the row's time, "look" to measure.
    """

    row: PlannedRow
    purpose: Purpose
    move: Move | Approach
    duration_s: float


def plan_stages(
    rows: Sequence[PlannedRow],
    start_mm: FloatArray,
    hold: Hold,
    speedup: float = 1.0,
    walk_mm: Sequence[FloatArray] = (),
) -> Iterator[Stage]:
    """The stages that measure `rows`, in order. start_mm : (n,) present scale values.

    hold : called with a row's quantities when the machine sets out for it. speedup : factor by which waiting and
    warming up take less time. walk_mm : points (n,) to visit first.
    """
    here_mm, direction = start_mm, np.ones_like(start_mm)
    now_s = start_s = 0.0
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
        start_s = now_s if row.begins else start_s
        due_s = start_s + row.time_s / speedup
        if due_s > now_s:
            yield Stage(row, "wait", rest, due_s - now_s)
            now_s = due_s
        look = Move(here_mm, row.end_mm, row.speed_mm_per_s) if row.on_the_move else rest
        yield Stage(row, "look", look, look.duration_s + DWELL_S)
        direction = np.where(row.approach != 0, row.approach, direction)
        here_mm, now_s = row.end_mm, now_s + look.duration_s + DWELL_S


class PlanMotion:
    """Motion through a plan's rows, at least one; at rest after the last."""

    point = None

    def __init__(
        self,
        rows: Sequence[PlannedRow],
        start: Approach,
        hold: Hold,
        speedup: float,
        walk_mm: Sequence[FloatArray],
    ) -> None:
        """start : how the links come to rest first. Else as for `plan_stages`."""
        stages = plan_stages(rows, start.end_mm, hold, speedup, walk_mm)
        self._stages = chain([Stage(rows[0], "walk", start, start.duration_s)], stages)
        self._stage: Stage | None = next(self._stages, None)
        self._since_s = 0.0
        self._rows = len(rows)
        self._row = rows[0]
        self.position_mm = start.position_mm(0.0)

    @property
    def done(self) -> bool:
        return self._stage is None

    @property
    def speeds_mm_per_s(self) -> FloatArray:
        return self._stage.move.speeds_mm_per_s(self._since_s) if self._stage else np.zeros_like(self.position_mm)

    @property
    def phase(self) -> Literal["moving", "dwelling"]:
        return "moving" if self._stage and self._since_s < self._stage.move.duration_s else "dwelling"

    def advance(self, time_s: float) -> float:
        """Advance by `time_s`; returns how many seconds of it the links moved."""
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

    def progress(self) -> Mapping[str, Any]:
        """Data for the TRUTH message: row and number of rows, purpose, present stage, and whether the plan is done."""
        doing = self._stage.purpose if self._stage else "done"
        return {
            "row": self._row.number,
            "rows": self._rows,
            "purpose": self._row.purpose,
            "doing": doing,
            "done": self.done,
        }
