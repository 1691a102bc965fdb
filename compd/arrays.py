"""Array types for annotations (docstrings give the shapes), and their root mean square."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]
BoolArray: TypeAlias = NDArray[np.bool_]
# Texts of any length: elements are str.
TextArray: TypeAlias = NDArray[np.object_]


def rms(values: ArrayLike) -> float:
    """Root mean square of all values; nan of none."""
    array = np.asarray(values, dtype=float)
    return float(np.sqrt(np.mean(np.square(array)))) if array.size else float("nan")
