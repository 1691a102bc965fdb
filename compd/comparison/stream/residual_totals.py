"""What a comparison reports of residuals, added up over blocks."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.comparison.comparison import Size
from compd.comparison.contributions import Contribution
from compd.comparison.stream.time_envelope import TimeEnvelope

# Bits of the fraction in which the numbers of a bin agree, besides sign and exponent: it is 1 / 1024 wide at most.
FRACTION_BITS = 10
_SHIFT = 52 - FRACTION_BITS
# um; amounts below the first count in the first bin, above the last in the last one.
SMALLEST, LARGEST = 2.0**-40, 2.0**40


def _bin(values: FloatArray) -> np.ndarray[tuple[int, ...], np.dtype[np.int64]]:
    """The bin of positive numbers, rising with them: the leading bits of their binary form."""
    return np.asarray(np.ascontiguousarray(values, dtype=np.float64).view(np.int64) >> _SHIFT)


_FIRST, _LAST = (int(_bin(np.array([limit]))[0]) for limit in (SMALLEST, LARGEST))


class MagnitudeHistogram:
    """Counts of |x| in bins of which each is 0.1 % wide.

    Example::

        >>> histogram = MagnitudeHistogram()
        >>> histogram.add(np.arange(-1000.0, 1000.0))
        >>> histogram.quantile(0.95)
        949.75
    """

    def __init__(self) -> None:
        self._counts = np.zeros(_LAST - _FIRST + 1, dtype=np.int64)

    def add(self, values: FloatArray) -> None:
        """values : (N,), finite."""
        bins = (_bin(np.abs(values)) - _FIRST).clip(0, len(self._counts) - 1)
        low = int(bins.min(initial=len(self._counts)))
        counts = np.bincount(bins - low)
        self._counts[low : low + len(counts)] += counts

    def quantile(self, share: float) -> float:
        """The amount that this share of all values stays below: the middle of its bin; nan of no values."""
        total = int(self._counts.sum())
        if not total:
            return float("nan")
        index = int(np.searchsorted(np.cumsum(self._counts), share * (total - 1), side="right"))
        edges = (np.array([index, index + 1], dtype=np.int64) + _FIRST) << _SHIFT
        return float(edges.view(np.float64).mean()) if index else 0.0


# Most outliers whose rows are kept.
MAX_OUTLIERS_LISTED = 1000


class ContributionSquares(NamedTuple):
    """Of one cause, over rows and coordinates: sum of squares of what it moves, of the residual without it, um^2."""

    moved: float
    without: float
    values: int

    def plus(self, other: ContributionSquares) -> ContributionSquares:
        """Of these values and of others."""
        return ContributionSquares(self.moved + other.moved, self.without + other.without, self.values + other.values)


class BlockResiduals(NamedTuple):
    """A block of N rows, of which U are used.

    rows : N.  row, time_s : (U,).  residual_um : (U, m).  distance_um : (U,).  registration_um : (m,) summed.
    outlier_row : (O,).  left_out : reason -> rows.  contributions : by the names of
    `compd.comparison.contributions`.
    """

    rows: int
    row: IntArray
    time_s: FloatArray
    residual_um: FloatArray
    distance_um: FloatArray
    registration_um: FloatArray
    outlier_row: IntArray
    left_out: Mapping[str, int]
    contributions: Mapping[str, ContributionSquares]


class ResidualTotals:
    """Sums over blocks.

    Attributes
    ----------
    rows, used, outliers : numbers of rows.
    left_out : reason -> rows that cannot be used.
    outlier_rows : the first MAX_OUTLIERS_LISTED of them.
    largest_um, largest_row : (m,) the largest amount of each coordinate, and its row.
    envelope : of the residual over time.
    """

    def __init__(self, coordinates: int, envelope: TimeEnvelope) -> None:
        self.rows = self.used = self.outliers = 0
        self.left_out: Counter[str] = Counter()
        self.outlier_rows: list[int] = []
        self.largest_um = np.full(coordinates, -np.inf)
        self.largest_row = np.zeros(coordinates, dtype=np.int64)
        self.envelope = envelope
        self._sum, self._squares, self._registration = (np.zeros(coordinates) for _ in range(3))
        self._histograms = [MagnitudeHistogram() for _ in range(coordinates)]
        self._distance_squares, self._largest_distance = 0.0, -np.inf
        self._distances = MagnitudeHistogram()
        self._contributions: dict[str, ContributionSquares] = {}

    def add(self, block: BlockResiduals) -> None:
        """Count a block; blocks come in the order of time."""
        self.rows += block.rows
        self.left_out.update(block.left_out)
        self.outliers += len(block.outlier_row)
        self.outlier_rows += block.outlier_row[: MAX_OUTLIERS_LISTED - len(self.outlier_rows)].tolist()
        for name, squares in block.contributions.items():
            before = self._contributions.get(name, ContributionSquares(0.0, 0.0, 0))
            self._contributions[name] = before.plus(squares)
        if not len(block.row):
            return
        self.used += len(block.row)
        self._sum += block.residual_um.sum(axis=0)
        self._squares += (block.residual_um**2).sum(axis=0)
        self._registration += block.registration_um
        size_um = np.abs(block.residual_um)
        index = size_um.argmax(axis=0)
        largest_um = size_um[index, np.arange(size_um.shape[1])]
        self.largest_row = np.where(largest_um > self.largest_um, block.row[index], self.largest_row)
        self.largest_um = np.maximum(largest_um, self.largest_um)
        for histogram, column in zip(self._histograms, size_um.T, strict=True):
            histogram.add(column)
        self._distance_squares += float(block.distance_um @ block.distance_um)
        self._largest_distance = max(self._largest_distance, float(block.distance_um.max()))
        self._distances.add(block.distance_um)
        self.envelope.add(block.time_s, block.residual_um)

    @property
    def rms_um(self) -> FloatArray:
        """(m,)."""
        return np.asarray(np.sqrt(self._squares / self.used))

    @property
    def mean_um(self) -> FloatArray:
        """(m,)."""
        return np.asarray(self._sum / self.used)

    @property
    def p95_um(self) -> FloatArray:
        """(m,) within 0.05 %, by a histogram."""
        return np.array([histogram.quantile(0.95) for histogram in self._histograms])

    @property
    def registration_um(self) -> FloatArray:
        """(m,) mean of what the instrument's frame or a constant takes off."""
        return np.asarray(self._registration / self.used)

    @property
    def distance(self) -> Size:
        """Of the residual vector's length."""
        rms_um = float(np.sqrt(self._distance_squares / self.used))
        return Size(rms_um, self._distances.quantile(0.95), self._largest_distance)

    @property
    def contributions(self) -> dict[str, Contribution]:
        """As of a recording in memory."""
        return {
            name: Contribution(float(np.sqrt(each.moved / each.values)), float(np.sqrt(each.without / each.values)))
            for name, each in self._contributions.items()
            if each.values
        }
