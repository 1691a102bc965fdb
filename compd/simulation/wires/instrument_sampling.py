"""Samples of a simulated instrument: as a track, at a constant rate, or one point per dwell."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from typing import Any

import numpy as np

from compd.arrays import FloatArray
from compd.errors import CompdError
from compd.instruments import LENGTH_AXES, POSITION_AXES, Samples

# Fewest samples of a dwell that gives a point: an instrument takes the mean of some readings.
MIN_LOOKS = 3


class Looks:
    """The answers to MEASURE, in the order of time.

    link : 1-based, of an interferometer along one link; None for a tracker, which sees the tip.
    """

    def __init__(self, link: int | None = None) -> None:
        self._link = link
        self._time_s: list[float] = []
        self._values_mm: list[list[float]] = []
        self._moving: list[bool] = []

    def __len__(self) -> int:
        return len(self._time_s)

    @property
    def axes(self) -> tuple[str, ...]:
        """As `Samples` names them."""
        return POSITION_AXES if self._link is None else LENGTH_AXES

    @property
    def instrument(self) -> str:
        """The instrument in words."""
        return "tracker" if self._link is None else f"interferometer along link {self._link}"

    @property
    def seconds(self) -> float:
        """Time (s) from the first sample to the last."""
        return self._time_s[-1] - self._time_s[0] if self._time_s else 0.0

    def check_links(self, links: int) -> None:
        """Raise CompdError if the machine has no such link. links : number of its links."""
        if self._link is not None and self._link > links:
            raise CompdError.of(
                "--link", "this machine has no such link", value=str(self._link), allowed=f"1 to {links}"
            )

    def add(self, measured: Mapping[str, Any]) -> None:
        """Add one answer MEASURED."""
        self._time_s.append(measured["monotonic_s"])
        self._values_mm.append(
            list(measured["reference_mm"]) if self._link is None else [measured["link_mm"][self._link - 1]]
        )
        self._moving.append(measured["moving"])

    def track(self, unit: str = "mm", start: datetime | None = None) -> Samples:
        """Every sample, on a clock that begins at 0."""
        return Samples(self.axes, np.array(self._values_mm), self._from_zero(), unit=unit, start=start)

    def at_rate(self, rate_hz: float, unit: str = "mm", start: datetime | None = None) -> Samples:
        """Samples at equal intervals, for files without times; linear interpolation."""
        time_s = self._from_zero()
        grid_s = np.arange(int(time_s[-1] * rate_hz) + 1) / rate_hz
        columns = [np.interp(grid_s, time_s, column) for column in np.array(self._values_mm).T]
        return Samples(self.axes, np.column_stack(columns), grid_s, unit=unit, start=start)

    def points(self, unit: str = "mm") -> Samples:
        """One point per dwell, without a time: the mean of its samples, named P1, P2 ..."""
        values = np.array(self._values_mm)
        means = [values[dwell].mean(axis=0) for dwell in self._dwells()]
        names = [f"P{number}" for number in range(1, len(means) + 1)]
        return Samples(self.axes, np.reshape(means, (-1, len(self.axes))), names=names, unit=unit)

    def _from_zero(self) -> FloatArray:
        return np.array(self._time_s) - self._time_s[0]

    def _dwells(self) -> list[slice]:
        """Samples between two motions, if there are enough of them."""
        still = np.concatenate([[False], ~np.array(self._moving, dtype=bool), [False]])
        begins, ends = np.flatnonzero(~still[:-1] & still[1:]), np.flatnonzero(still[:-1] & ~still[1:])
        return [
            slice(int(begin), int(end)) for begin, end in zip(begins, ends, strict=True) if end - begin >= MIN_LOOKS
        ]
