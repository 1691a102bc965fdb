"""How long own kinematics takes, seen in STATUS: a person's own code may make every cycle late."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TypeVar

from numpy.typing import ArrayLike

from compd.arrays import FloatArray
from compd.clock import Clock
from compd.live.loop.timing import Histogram
from compd.model.external import Kinematics

_ResultT = TypeVar("_ResultT")


class TimedKinematics(Kinematics):
    """Own kinematics whose every call is timed; what it gives and raises is unchanged."""

    def __init__(self, own: Kinematics, *, cost: Histogram, clock: Clock) -> None:
        """`cost`: gets the time of each call, in shared memory."""
        self._own = own
        self._cost = cost
        self._clock = clock

    @property
    def name(self) -> str:
        return self._own.name

    @property
    def settings(self) -> tuple[str, ...]:  # type: ignore[override]
        return tuple(self._own.settings)

    @property
    def gives(self) -> tuple[str, ...]:  # type: ignore[override]
        return tuple(self._own.gives)

    def pose(self, scale_mm: FloatArray, settings: Mapping[str, float]) -> ArrayLike:
        return self._timed(lambda: self._own.pose(scale_mm, settings))

    def derivatives(self, scale_mm: FloatArray, settings: Mapping[str, float]) -> ArrayLike:
        return self._timed(lambda: self._own.derivatives(scale_mm, settings))

    def columns(self, scale_mm: FloatArray, settings: Mapping[str, float]) -> Mapping[str, float]:
        return self._timed(lambda: self._own.columns(scale_mm, settings))

    def _timed(self, call: Callable[[], _ResultT]) -> _ResultT:
        start_s = self._clock.monotonic()
        try:
            return call()
        finally:
            self._cost.add(self._clock.monotonic() - start_s)
