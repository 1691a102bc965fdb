"""An export that has times, as a track: where the instrument's target was at any time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from compd.arrays import FloatArray
from compd.instruments.axes import ATTITUDE_AXES
from compd.instruments.export import InstrumentExport
from compd.instruments.time_stamps import check_rising
from compd.tables import ProblemList

LENGTH = "length"
# 1 / 0.6745: the standard deviation of a normal distribution over its median absolute deviation.
_STD_PER_MEDIAN = 1.4826
MIN_ROWS = 3
# Two tracks in one: least distance (mm) of rows from the next, factor by which the one after is nearer, fewest such
# rows, and their least share of the rows in between. Two in turn make it of every row, two at random of a quarter.
_FAR_MM = 0.1
_BACK = 0.1
_MIN_MIXED = 20
_SHARE_MIXED = 0.15


@dataclass(frozen=True)
class Track:
    """The positions or lengths that an instrument measured, sample by sample."""

    path: Path  #: the export
    time_s: FloatArray  #: (M,) on the instrument's clock, strictly rising
    position_mm: FloatArray  #: (M, d) on `axes`: a subset of "x", "y", "z", or "length" alone
    axes: tuple[str, ...]
    taken: Mapping[str, str] = field(default_factory=dict)  #: what was taken for what, for a person
    left_out: Mapping[str, int] = field(default_factory=dict)  #: reason -> rows of the export that are not there
    rotation_rad: FloatArray | None = None  #: (M, 3) attitude, a rotation vector; None if none was measured
    time_std_s: float = 0.0  #: standard uncertainty of one time, beside that of the clock's offset

    @property
    def period_s(self) -> float:
        """Median time between two samples."""
        return float(np.median(np.diff(self.time_s)))

    @property
    def noise_mm(self) -> float:
        """Standard deviation per axis, robustly, from each sample against the mean of its two neighbours."""
        return _noise(self.position_mm)

    @property
    def rotation_noise_rad(self) -> float:
        """As `noise_mm`, of the attitude; nan where none was measured."""
        return np.nan if self.rotation_rad is None else _noise(self.rotation_rad)

    def position_at(self, time_s: FloatArray) -> FloatArray:
        """(N, d) position at times of the instrument's clock, linear between samples, held beyond the ends."""
        return np.column_stack([np.interp(time_s, self.time_s, column) for column in self.position_mm.T])

    def rotation_at(self, time_s: FloatArray) -> FloatArray:
        """(N, 3) attitude, a rotation vector, as `position_at`; on the shortest arc between samples.

        Raises ValueError if no attitude was measured.
        """
        if self.rotation_rad is None:
            raise ValueError("no attitude was measured")
        attitude = Slerp(self.time_s, Rotation.from_rotvec(self.rotation_rad))
        return np.asarray(attitude(np.clip(time_s, self.time_s[0], self.time_s[-1])).as_rotvec(), dtype=np.float64)


def track_of(export: InstrumentExport) -> Track:
    """The track of an export whose rows have times.

    Raises RecordingError if they have none, fall or stand still, or are fewer than three.
    """
    problems = ProblemList(export.path)
    if export.time_s is None:
        problems.add(
            0,
            "no column is a time",
            "; ".join(f"{role}: {text}" for role, text in export.taken.items()),
            "e.g. time_s, or stamps of date and time",
            "name it with --time, or say how many rows there are in a second with --rate-hz",
        )
        problems.check()
    assert export.time_s is not None
    next_step = "choose one group of points with --group where there are several, or sort the rows"
    rising = check_rising(export.time_s, export.line, next_step, problems)
    if rising and (mixed := _mixed_rows(export.values)) is not None:
        problems.add(
            int(export.line[mixed[0]]),
            f"its rows are of two tracks in turn, up to line {export.line[mixed[1]]}",
            allowed="one track, in the order of measuring",
            next_step="export it again and do not sort it: a clock that was set back gives the same times twice, which "
            "--clock-set-back takes apart",
        )
    if len(export.time_s) < MIN_ROWS:
        problems.add(
            0,
            f"{len(export.time_s)} rows have a time and {', '.join(export.axes)}",
            allowed="three rows or more",
        )
    problems.check()
    attitude = [k for k, axis in enumerate(export.axes) if axis in ATTITUDE_AXES]
    position = [k for k, axis in enumerate(export.axes) if axis not in ATTITUDE_AXES]
    return Track(
        path=export.path,
        time_s=export.time_s,
        position_mm=export.values[:, position],
        axes=tuple(export.axes[k] for k in position),
        taken=export.taken,
        left_out=export.left_out,
        rotation_rad=export.values[:, attitude] if attitude else None,
        time_std_s=export.time_std_s,
    )


def _mixed_rows(position_mm: FloatArray) -> tuple[int, int] | None:
    """The first and the last row (M, d) of two tracks that are mixed, as where rows of two hours are sorted by a clock
    that was set back; None without any.

    There a row is often far from the next one, and near to the one after that.
    """
    if len(position_mm) < 3:
        return None
    next_mm = np.linalg.norm(np.diff(position_mm, axis=0), axis=1)
    second_mm = np.linalg.norm(position_mm[2:] - position_mm[:-2], axis=1)
    to_and_fro = np.flatnonzero((next_mm[:-1] > _FAR_MM) & (second_mm < _BACK * next_mm[:-1]))
    if len(to_and_fro) < _MIN_MIXED:
        return None
    first, last = int(to_and_fro[0]), int(to_and_fro[-1])
    return (first, last) if len(to_and_fro) >= _SHARE_MIXED * (last - first) else None


def _noise(values: FloatArray) -> float:
    """Steady motion cancels against the neighbours' mean; white noise of variance sigma^2 gives it 3/2 sigma^2."""
    middle = values[1:-1] - (values[2:] + values[:-2]) / 2.0
    return float(_STD_PER_MEDIAN * np.median(np.abs(middle)) / np.sqrt(1.5))
