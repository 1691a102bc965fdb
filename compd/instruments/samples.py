"""What an instrument has measured, before it is written in one of the formats."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

import numpy as np

from compd.arrays import FloatArray
from compd.errors import CompdError
from compd.instruments.axes import ATTITUDE_AXES, LENGTH_AXES, POSE_AXES, POSITION_AXES
from compd.units import unit_factor

LENGTH, POSITION, POSE = LENGTH_AXES, POSITION_AXES, POSE_AXES


@dataclass(frozen=True)
class Samples:
    """N samples or points."""

    axes: Sequence[str]  #: names of the columns of `values`, as in `InstrumentExport`
    values: FloatArray  #: (N, d) mm, attitude in rad
    time_s: FloatArray | None = None  #: (N,) on the instrument's clock; None for points without a time
    names: Sequence[str] | None = None  #: (N,) of the points; None if they have none
    unit: str = "mm"  #: in which lengths are to be written
    #: calendar time at which `time_s` is 0; needed by shapes that stamp their rows with a date
    start: datetime | None = None
    group: str = "Points"  #: of the points, for shapes that have groups

    @property
    def written_values(self) -> FloatArray:
        """(N, d) lengths in `unit`, attitude in rad. Raises CompdError if `unit` is no unit of a length."""
        factor = unit_factor("mm", self.unit)
        if factor is None:
            raise CompdError.of("unit", "is no unit of a length", value=self.unit)
        attitude = [axis in ATTITUDE_AXES for axis in self.axes]
        return np.asarray(np.where(attitude, self.values, self.values * factor))

    @property
    def rate_hz(self) -> float:
        """Samples per second: of samples at equal distances in time."""
        assert self.time_s is not None
        return (len(self.time_s) - 1) / float(self.time_s[-1] - self.time_s[0])

    def header(self, time_name: str) -> list[str]:
        """Names of the columns with their units. time_name : of the column of the time; "" if there is none."""
        units = ["rad" if axis in ATTITUDE_AXES else self.unit for axis in self.axes]
        return [
            *([time_name] if time_name else []),
            *(["name"] if self.names is not None else []),
            *(f"{axis}_{unit}" for axis, unit in zip(self.axes, units, strict=True)),
        ]

    def stamps(self) -> list[datetime] | None:
        """Calendar time of every row; None without a time. Raises CompdError without `start`."""
        if self.time_s is None:
            return None
        if self.start is None:
            raise CompdError.of("start", "is needed: this format stamps its rows with a date")
        return [self.start + timedelta(seconds=time_s) for time_s in self.time_s.tolist()]

    def need(self, shape: str, *allowed: tuple[str, ...], time: bool = False) -> None:
        """Raise CompdError if this shape cannot hold the samples.

        allowed : sets of axes that it takes. time : whether it needs a time.
        """
        if tuple(self.axes) not in allowed:
            axes = " or ".join(", ".join(some) for some in allowed)
            raise CompdError.of(shape, "has no place for these", value=", ".join(self.axes), allowed=axes)
        if time and self.time_s is None:
            raise CompdError.of(
                shape,
                "is samples at a constant rate, and these are points without a time",
                next_step="choose another format for points",
            )
        if time and len(self.values) < 2:
            raise CompdError.of(shape, "has no rate with fewer than two samples")
