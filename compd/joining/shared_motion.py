"""The motion that the scales and an instrument both recorded: how well it agrees at an offset between their clocks."""

from __future__ import annotations

from itertools import combinations_with_replacement

import numpy as np

from compd.arrays import BoolArray, FloatArray
from compd.errors import RecordingError
from compd.instruments import Track

# Least motion (mm) of both for a visible pattern; ten times that of a reversal.
MOTION_MM = 0.01
# Least independent places per term of the polynomial: in the whole recording, and in the overlapping part.
_PLACES_PER_TERM = 5
_MIN_PLACES_PER_TERM = 2
# Most rows in the regression.
_MAX_ROWS = 2000


class SharedMotion:
    """The motion as recorded by the scales and by the instrument, thinned to the rows needed.

    Attributes
    ----------
    all_time_s, all_scale_mm : (M,), (M, n) rows with every scale.
    time_s : (N,) of the thinned rows. travel : (N,) path so far in units of the places' spread.
    terms : (N, p) monomials of the scales; None if there are too few places for any.
    period_s : median time between two rows.
    """

    def __init__(self, time_s: FloatArray, scale_mm: FloatArray, track: Track) -> None:
        complete = np.isfinite(scale_mm).all(axis=1)
        self.track = track
        self.all_time_s, self.all_scale_mm = time_s[complete], scale_mm[complete]
        thin = slice(None, None, -(-max(len(self.all_time_s), 1) // _MAX_ROWS))
        self.time_s = self.all_time_s[thin]
        self.travel = _travel(self.all_scale_mm)[thin]
        places = min(len(self.time_s), int(self.travel.max(initial=0.0)))
        self.terms = _monomials(self.all_scale_mm[thin], places)
        self.period_s = float(np.median(np.diff(self.time_s))) if len(self.time_s) > 1 else 0.0

    def check(self) -> None:
        """Raise RecordingError if there is too little motion for a pattern."""
        for what, values in (("the machine", self.all_scale_mm), ("the instrument", self.track.position_mm)):
            moved_mm = float(np.ptp(values, axis=0).max()) if len(values) else 0.0
            if moved_mm < MOTION_MM:
                raise self.refusal(
                    f"{what} stands still all the time", f"{moved_mm:.6f} mm", f"a motion of more than {MOTION_MM} mm"
                )
        if self.terms is None:
            scales = self.all_scale_mm.shape[1]
            raise self.refusal(
                "too few rows or places to see a pattern",
                f"{len(self.time_s)} rows",
                f"{_PLACES_PER_TERM * (scales + 1)} places far from each other",
            )

    def refusal(self, what: str, value: str, allowed: str) -> RecordingError:
        """The error that the offset cannot be estimated."""
        return RecordingError.of(
            str(self.track.path),
            f"the clock offset cannot be determined: {what}",
            value=value,
            allowed=allowed,
            next_step="record with moves between dwells of different length, or give --offset S; join points at "
            "rest --by order, name or distance",
        )

    def covered(self, earliest_s: float, latest_s: float) -> BoolArray:
        """(N,) rows that the track covers at every offset between the two."""
        first_s, last_s = float(self.track.time_s[0]), float(self.track.time_s[-1])
        rows: BoolArray = (self.time_s - latest_s >= first_s) & (self.time_s - earliest_s <= last_s)
        return rows

    def agreement(self, offset_s: float) -> float:
        """As `agreements`, of one offset on all rows that it covers."""
        return float(self.agreements(np.array([offset_s]), self.covered(offset_s, offset_s))[0])

    def agreements(self, offsets_s: FloatArray, rows: BoolArray) -> FloatArray:
        r"""Adjusted coefficient of determination on `rows` at each offset; nan where there are too few places.

        With :math:`y` the centred positions at an offset, :math:`Q` an orthonormal basis of the :math:`p` monomials and
        :math:`m` independent places: :math:`1 - (|y - Q Q^T y|^2 / |y|^2) (m - 1) / (m - p)`.
        """
        travel = self.travel[rows]
        places = min(len(travel), float(np.ptp(travel))) if len(travel) else 0.0
        if self.terms is None or places < _MIN_PLACES_PER_TERM * self.terms.shape[1]:
            return np.full(len(offsets_s), np.nan)
        basis, _ = np.linalg.qr(self.terms[rows])
        result = np.empty(len(offsets_s))
        for i, offset_s in enumerate(offsets_s):
            position_mm = self.track.position_at(self.time_s[rows] - offset_s)
            position_mm -= position_mm.mean(axis=0)
            residual_mm = position_mm - basis @ (basis.T @ position_mm)
            total = max(float(np.sum(position_mm**2)), 1e-30)
            unexplained = float(np.sum(residual_mm**2)) / total
            result[i] = 1.0 - unexplained * (places - 1.0) / (places - basis.shape[1])
        return result


def _travel(scale_mm: FloatArray) -> FloatArray:
    """(N,) length of the path so far over the spread of the places: how many independent places were visited.

    A row every millisecond is not a thousand places a second. For random targets a move is 1.3 times the spread.
    """
    if len(scale_mm) < 2:
        return np.zeros(len(scale_mm))
    path_mm = np.cumsum(np.linalg.norm(np.diff(scale_mm, axis=0, prepend=scale_mm[:1]), axis=1))
    travel: FloatArray = path_mm / max(float(np.sqrt(np.var(scale_mm, axis=0).sum())), MOTION_MM)
    return travel


def _monomials(scale_mm: FloatArray, places: int) -> FloatArray | None:
    """(N, p) monomials of the scales up to degree 3, 2 or 1, as the places allow; None where even 1 is too much."""
    rows, scales = scale_mm.shape
    spread_mm = np.maximum(np.std(scale_mm, axis=0), 1e-9) if rows else np.ones(scales)
    standardised = (scale_mm - (scale_mm.mean(axis=0) if rows else 0.0)) / spread_mm
    for degree in (3, 2, 1):
        monomials = [
            factors for order in range(degree + 1) for factors in combinations_with_replacement(range(scales), order)
        ]
        if places >= _PLACES_PER_TERM * len(monomials):
            return np.column_stack([np.prod(standardised[:, list(factors)], axis=1) for factors in monomials])
    return None
