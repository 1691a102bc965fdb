"""A histogram of amounts of any size, from which quantiles follow within 0.05 %."""

from __future__ import annotations

import numpy as np

from compd.arrays import FloatArray

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
