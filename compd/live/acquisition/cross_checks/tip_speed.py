"""CMM mode: the tip does not move faster than the machine can."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from compd.arrays import FloatArray
from compd.live.acquisition.cross_checks.machine_view import Contradiction, MachineView

# Over a shorter time, s, the times of readings make a speed uncertain.
_SHORTEST_S = 0.05
# Between setpoints that are further apart, s, nobody knows how the tip has moved.
_LONGEST_S = 1.0


class TipSpeed:
    """Compares the tips of setpoints; the scale that has moved most is named."""

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
        if last is not None and now[0] - last[0] < _SHORTEST_S:
            return
        self._last, before_s = now, self._oldest_s
        self._oldest_s = min(now[0], float(view.memory.time_s[scales].min()))
        if last is None or now[0] - last[0] > _LONGEST_S:
            return
        # a scale that was not read for a while has come all the way since then
        speed = float(np.linalg.norm(now[1] - last[1])) / (now[0] - before_s)
        if speed > self._largest_mm_per_s:
            i = scales[int(np.argmax(np.abs(now[2] - last[2])[scales]))]
            yield Contradiction(i, f"the tip would move at {speed:.0f} mm/s, allowed {self._largest_mm_per_s:g} mm/s")
