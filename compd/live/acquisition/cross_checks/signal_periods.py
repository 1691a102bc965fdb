"""Steps of one scale while all lengths are at rest: signal periods lost by its interpolator.

In machine-tool mode the setpoint says whether the link was to move. In CMM mode a link may be moved on purpose, alone
and by such a step: a second step without a reading on the way is needed, and until then there is a warning. Steps are
summed with their sign, and compared with the signal period: what is lost and found again does no harm. A link that
readings show on the way, while all others stand, is moved on purpose: the sum begins anew.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.live.acquisition.cross_checks.following_error import LASTING_S
from compd.live.acquisition.cross_checks.machine_view import Contradiction, MachineView, Remark
from compd.live.acquisition.steps import Step
from compd.units import UM_PER_MM

# Age (s) from which steps no longer count: a link is moved on purpose once in a while.
MEMORY_S = 3600.0
# Fewest steps in CMM mode.
MIN_STEPS = 2
# Longest wait (s) after a step until all other lengths have been read; the step is undecided after that.
_WAIT_S = 2.0
_QUARTERS = 4


class _Look(NamedTuple):
    now_s: float
    value: FloatArray
    setpoint_mm: FloatArray | None  # setpoints of the scales in machine-tool mode


class SignalPeriods:
    """Sums the steps that a scale makes alone."""

    def __init__(self, period_mm: float) -> None:
        self._period_mm = period_mm
        self._looks: deque[_Look] = deque()
        self._known: dict[int, tuple[float, float]] = {}  # number and size (mm) of each channel's steps until now
        self._waiting: dict[int, Step] = {}
        self._steps: dict[int, list[Step]] = {}
        self._accepted: list[int] = []

    def look(self, view: MachineView) -> Iterator[Contradiction | Remark]:
        memory, n = view.memory, view.memory.lengths
        accepted, self._accepted = self._accepted, memory.accepted[:n].tolist()
        self._looks.append(_Look(view.now_s, view.value.copy(), _setpoint_mm(view)))
        while self._looks[0].now_s < view.now_s - LASTING_S - 2 * _WAIT_S:
            self._looks.popleft()
        # the count first: a step whose height is already stored is then taken at the next look
        stepped, stepped_mm = memory.stepped[:n].tolist(), memory.stepped_mm[:n].tolist()
        for i in view.of_kind("scale"):
            if not view.believed[i] or (accepted and accepted[i] != self._accepted[i]):
                self._waiting.pop(i, None)
                self._steps.pop(i, None)
                self._known[i] = stepped[i], stepped_mm[i]
                continue
            number, sum_mm = self._known.setdefault(i, (stepped[i], stepped_mm[i]))
            if stepped[i] != number:
                height_mm = stepped_mm[i] - sum_mm
                self._waiting[i] = Step(height_mm, float(memory.stepped_s[i]), height_mm == 0.0)
                self._known[i] = stepped[i], stepped_mm[i]
            if i in self._waiting:
                self._judge(view, i, self._waiting[i])
            yield from self._sum(view, i)

    def _judge(self, view: MachineView, i: int, step: Step) -> None:
        """Count a step where the others have stood, as soon as that can be said."""
        others = [j for j in range(view.memory.lengths) if j != i and view.believed[j]]
        before = next((look for look in reversed(self._looks) if look.now_s <= step.time_s), None)
        read = bool((view.memory.time_s[others] > step.time_s).all())
        if not read and view.now_s < step.time_s + _WAIT_S:
            return
        del self._waiting[i]
        if not read or before is None or not any(view.wired[j].kind == "scale" for j in others):
            return
        moved_mm = np.abs(view.value - before.value)[others]
        if not (moved_mm <= view.memory.tolerance_mm[others]).all() or self._was_told(view, i, step):
            return
        if step.is_seen:  # this link is moved alone
            self._steps.pop(i, None)
        else:
            self._steps.setdefault(i, []).append(step)

    def _was_told(self, view: MachineView, i: int, step: Step) -> bool:
        """Whether the setpoint of this scale has moved in the time in which a controller follows."""
        link = view.wired[i].link - 1
        told = [
            float(look.setpoint_mm[link])
            for look in self._looks
            if look.now_s >= step.time_s - LASTING_S and look.setpoint_mm is not None
        ]
        return len(told) > 0 and max(told) - min(told) > float(view.memory.tolerance_mm[i])

    def _sum(self, view: MachineView, i: int) -> Iterator[Contradiction | Remark]:
        steps = [step for step in self._steps.get(i, ()) if step.time_s > view.now_s - MEMORY_S]
        self._steps[i] = steps
        sum_mm = sum(step.height_mm for step in steps)
        tolerance_mm = float(view.memory.tolerance_mm[i])
        if abs(sum_mm) <= tolerance_mm:
            self._steps.pop(i)
            return
        controlled = self._looks[-1].setpoint_mm is not None
        enough = len(steps) >= (1 if controlled else MIN_STEPS)
        text = self._text(steps, sum_mm, tolerance_mm, controlled)
        if enough and abs(sum_mm) >= self._period_mm - tolerance_mm:
            self._steps.pop(i)
            yield Contradiction(i, f"{text}: it has lost signal periods, or this link was moved alone")
        else:
            yield Remark(i, f"{text}: has it lost a signal period, or was this link moved alone?")

    def _text(self, steps: list[Step], sum_mm: float, tolerance_mm: float, controlled: bool) -> str:
        quarter_mm = self._period_mm / _QUARTERS
        whole = all(abs(math.remainder(step.height_mm, quarter_mm)) <= tolerance_mm for step in steps)
        of = f"whole quarters of its signal period of {self._period_mm * UM_PER_MM:g} um, " if whole else ""
        times = "once" if len(steps) == 1 else f"{len(steps)} times"
        told = " and its setpoint stood" if controlled else ""
        return (
            f"stepped at rest {times}, by {sum_mm * UM_PER_MM:+.1f} um, {of}while all other lengths{told or ' stood'}"
        )


def _setpoint_mm(view: MachineView) -> FloatArray | None:
    setpoint = view.setpoint
    if setpoint is None or setpoint["mode"] != "machine_tool" or not setpoint["valid"]:
        return None
    scales_mm = setpoint.get("scale_setpoint_mm")
    return None if scales_mm is None else np.array(scales_mm, dtype=float)
