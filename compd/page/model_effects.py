"""Tip displacement by models: the correction of the applied one, and the additional one of the shadow."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any

import numpy as np

from compd.arrays import FloatArray

Message = Mapping[str, Any]

SPAN_S = 60.0
# Sources measured by gauges at joints and frame: they are corrected without a model of effects.
_WITHOUT_EFFECTS = ("joints", "frame")


class ModelEffects:
    """Root mean squares over the last minute, or since the running models changed.

    Every number is of models alone: live, no reference says where the tip is.
    """

    def __init__(self) -> None:
        self._models: object = None
        self._last_budget: Message | None = None
        self._rows: deque[tuple[float, FloatArray, FloatArray]] = deque()

    def note(self, budget: Message | None, models: Message | None) -> None:
        """Take the newest BUDGET once; `models`: the newest MODEL. None while the daemon is unreachable."""
        if models != self._models:
            self._models = models
            self._rows.clear()
        elif budget is not None and budget is not self._last_budget and models is not None and "tip_um" in budget:
            self._put(budget)
        # a budget from before the change of models may describe the previous ones
        self._last_budget = budget

    def _put(self, budget: Message) -> None:
        by_cause = {cause: np.array(moved_um) for cause, moved_um in budget["tip_um"].items()}
        effects_um = sum((by_cause[cause] for cause in by_cause if cause not in _WITHOUT_EFFECTS), np.zeros(3))
        shadow_um = np.array(budget.get("shadow_tip_um", [np.nan] * 3), dtype=float)
        self._rows.append((budget["time_s"], effects_um, shadow_um - sum(by_cause.values(), np.zeros(3))))
        while self._rows[-1][0] - self._rows[0][0] > SPAN_S:
            self._rows.popleft()

    def summary(self) -> dict[str, Any]:
        """`applied_um`: what the effects of the applied model move the tip by, in x, y, z, um; `beyond_um`: what the
        shadow moves it by beyond all that is applied. None if there is nothing. `seconds`: how long they are of.
        """
        if not self._rows:
            return {"seconds": 0.0, "applied_um": None, "beyond_um": None}
        times_s, applied_um, beyond_um = zip(*self._rows, strict=True)
        seconds = round(times_s[-1] - times_s[0], 1)
        return {"seconds": seconds, "applied_um": _rms(applied_um), "beyond_um": _rms(beyond_um)}


def _rms(rows_um: tuple[FloatArray, ...]) -> list[float] | None:
    """Root mean square of each axis; None without numbers."""
    rows = np.array(rows_um)
    rows = rows[np.isfinite(rows).all(axis=1)]
    return np.sqrt(np.mean(rows**2, axis=0)).round(4).tolist() if len(rows) else None
