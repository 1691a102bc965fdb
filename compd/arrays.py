"""Array types for annotations (docstrings give the shapes), and their root mean square."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]
BoolArray: TypeAlias = NDArray[np.bool_]


def rms(values: FloatArray) -> float:
    """Root of the mean square over all values; nan of none."""
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else float("nan")
