"""Columns of a description in standard deviations of the noise."""

from __future__ import annotations

import numpy as np

from compd.arrays import BoolArray, FloatArray
from compd.comparison.aligned_recording import AlignedRecording
from compd.diagnosis.empirical_terms import EmpiricalTerm
from compd.model.effect import Effect
from compd.units import UM_PER_MM


class Whitening:
    """Columns of a description in standard deviations of the noise, on the rows that count."""

    def __init__(self, aligned: AlignedRecording, rows: BoolArray, sigma_um: FloatArray) -> None:
        self.aligned, self._rows, self._sigma_um = aligned, rows, sigma_um

    def columns_um(self, description: EmpiricalTerm, effect: Effect, constant: float | None) -> FloatArray:
        """(N, m, P): all numbers of the first axis, then of the next."""
        shape = {} if constant is None else {description.constant: constant}
        if description.axes == ("",):
            return self.aligned.columns(effect, shape) * UM_PER_MM
        factors, _ = effect.basis(self.aligned.rows, shape, None)
        factors = factors[:, "xyz".index(description.axes[0])] * UM_PER_MM
        along = self._along(description)
        return np.asarray((along[:, :, :, None] * factors[:, None, None, :]).reshape(*along.shape[:2], -1))

    def _along(self, description: EmpiricalTerm) -> FloatArray:
        """(N, m, axes) what is measured of a displacement along each axis at the port."""
        axes = ["xyz".index(axis) for axis in description.axes]
        if description.port == "reference":
            return np.broadcast_to(
                np.eye(3)[list(self.aligned.axes)][:, axes], (len(self.aligned.rows), len(self.aligned.axes), len(axes))
            )
        return self.aligned.sensitivity(["tool"])["tool"].tip[:, list(self.aligned.axes)][:, :, axes]

    def __call__(self, columns_um: FloatArray) -> FloatArray:
        """(R, m, P)."""
        return np.asarray(columns_um[self._rows] / self._sigma_um[:, None])
