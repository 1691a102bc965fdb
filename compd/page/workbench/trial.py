"""Trial of an effect by hand: the change of the residual by each of its numbers.

An effect is linear in its numbers theta: the residual beside it is ``r - J theta``. A browser has J for the rows that
it draws, and the sums over all rows that the error is computed from::

    n rms^2 = r'r - 2 theta' J'r + theta' J'J theta

What every fit contains, such as a frame of the instrument's own, is taken out of J: it would follow at once.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.comparison import Comparison
from compd.model.effects import ConstantValues
from compd.page.packed import packed


@dataclass(frozen=True, eq=False)
class Trial:
    """One effect at one choice of its constants, against one comparison of N rows with m coordinates.

    columns_um : (N, m, P) by how many um each number moves the prediction, beside what every fit contains.
    gram : (P, P) J'J over the values used.  moment : (P,) J'r.  square : r'r.  values : how many values these sum.
    """

    constants: ConstantValues
    columns_um: FloatArray
    gram: FloatArray
    moment: FloatArray
    square: float
    values: int

    def rms_um(self, theta: FloatArray) -> float:
        """The error per coordinate with these numbers (P,), um."""
        left = float(self.square - 2 * theta @ self.moment + theta @ self.gram @ theta)
        return float(np.sqrt(max(left, 0.0) / self.values))

    def pack(self, rows: IntArray, header: Mapping[str, Any]) -> bytes:
        """Data for a browser: the sums, and the columns of some rows (R,)."""
        sums = {"square": self.square, "values": self.values, "constants": dict(self.constants)}
        arrays = {"gram": self.gram, "moment": self.moment, "columns": self.columns_um[rows]}
        return packed({**header, **sums}, arrays)


def trial(comparison: Comparison, fitted_along: FloatArray, columns_um: FloatArray, constants: ConstantValues) -> Trial:
    """The trial of an effect with these columns (N, m, P), um.

    fitted_along : (N, m, Q) columns of what every fit contains, um.
    """
    counted: BoolArray = comparison.used & np.isfinite(columns_um).all(axis=(1, 2))
    beside = _beside(fitted_along, columns_um, counted)
    lengths = comparison.aligned.lengths
    flat = beside[counted][:, lengths].reshape(-1, beside.shape[2])
    residual = comparison.residual_um[counted][:, lengths].ravel()
    return Trial(constants, beside, flat.T @ flat, flat.T @ residual, float(residual @ residual), residual.size)


def _beside(fitted_along: FloatArray, columns_um: FloatArray, counted: BoolArray) -> FloatArray:
    """(N, m, P) columns without their part that jointly fitted terms explain on the rows that count."""
    if not fitted_along.shape[2]:
        return columns_um
    along = fitted_along[counted].reshape(-1, fitted_along.shape[2])
    share, *_ = np.linalg.lstsq(along, columns_um[counted].reshape(-1, columns_um.shape[2]), rcond=None)
    return np.asarray(columns_um - fitted_along @ share)
