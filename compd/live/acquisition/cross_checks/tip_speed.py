"""CMM mode: a scale is wrong if the tip would move faster than the machine can."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from compd.arrays import FloatArray
from compd.live.acquisition.cross_checks.machine_view import Contradiction, MachineView

# Shortest time (s) over which a speed is taken; below it the times of readings make it uncertain.
_MIN_S = 0.05
# Longest interval (s) of setpoints; beyond it the tip's path is unknown.
_MAX_S = 1.0


class TipSpeed:
    """Compares the tips of setpoints; names the scale that has moved most."""

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
