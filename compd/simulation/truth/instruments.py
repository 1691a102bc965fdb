"""Reference instruments: their noise and outliers, and the certificate of a ball plate."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from compd.arrays import FloatArray

# Standard uncertainty per axis: three-beam laser tracking at half a metre; a plane-mirror interferometer.
TRACKER_SIGMA_UM = 0.15
INTERFEROMETER_SIGMA_UM = 0.05
UM = 1e-3
# Size of an outlier (a beam cut or scattered), in sigmas.
OUTLIER_SIGMAS = (8.0, 40.0)

# Repeatability of a ballbar's sensor over a sweep; its length is not calibrated to that.
BALLBAR_SIGMA_UM = 0.2
# Attitude by three reflectors 100 mm apart, each measured as the tip is.
POSE_SIGMA_URAD = 2.0

Kind = Literal["tracker", "interferometer", "ball_plate", "ballbar", "pin", "ball", "pose"]

# A 3D ball plate: two rings of eight balls, the upper one turned by half a step, and one ball in the middle.
BALLS = 17
RING_MM = (75.0, 45.0)
LEVELS_MM = (-30.0, 25.0)


@dataclass(frozen=True)
class ReferenceInstrument:
    """An instrument that measures the tip (or, an interferometer, the links' lengths) beside the gauges.

    sigma_um : standard uncertainty per coordinate; 0 for an exact instrument.
    outlier_share : probability that one coordinate of a measurement is an outlier.
    sigma_urad : standard uncertainty of an attitude about each axis; 0 where none is measured.
    """

    kind: Kind
    sigma_um: float
    outlier_share: float = 0.0
    sigma_urad: float = 0.0

    def measure(self, true_mm: FloatArray, rng: np.random.Generator) -> FloatArray:
        """(m,) true values with normal noise, and at random an outlier."""
        measured_mm = true_mm + self.sigma_um * UM * rng.standard_normal(true_mm.shape)
        if rng.uniform() < self.outlier_share:
            off = rng.uniform(*OUTLIER_SIGMAS) * rng.choice([-1.0, 1.0])
            measured_mm[rng.integers(len(measured_mm))] += off * self.sigma_um * UM
        return np.asarray(measured_mm)

    def measure_attitude(self, rotation_M_P: FloatArray, rng: np.random.Generator) -> FloatArray:
        """(3,) rotation vector in rad of an attitude (3, 3) that is turned by normal noise about each axis of {M}."""
        noise = Rotation.from_rotvec(self.sigma_urad * 1e-6 * rng.standard_normal(3))
        return np.asarray((noise * Rotation.from_matrix(rotation_M_P)).as_rotvec())


EXACT = ReferenceInstrument("tracker", 0.0)
TRACKER = ReferenceInstrument("tracker", TRACKER_SIGMA_UM)
INTERFEROMETER = ReferenceInstrument("interferometer", INTERFEROMETER_SIGMA_UM)
# The machine probes the balls: its own repeatability.
BALL_PLATE = ReferenceInstrument("ball_plate", TRACKER_SIGMA_UM)
# The machine's own repeatability again: of the seat of the tip in a pin, and of a touch.
PIN = ReferenceInstrument("pin", TRACKER_SIGMA_UM)
BALL = ReferenceInstrument("ball", TRACKER_SIGMA_UM)
BALLBAR = ReferenceInstrument("ballbar", BALLBAR_SIGMA_UM)
POSE = ReferenceInstrument("pose", TRACKER_SIGMA_UM, sigma_urad=POSE_SIGMA_URAD)
INSTRUMENTS: Mapping[Kind, ReferenceInstrument] = {
    instrument.kind: instrument for instrument in (TRACKER, INTERFEROMETER, BALL_PLATE, BALLBAR, PIN, BALL, POSE)
}


def ball_plate_mm(middle: FloatArray) -> FloatArray:
    """(17, 3) calibrated centres of the balls about `middle` (3,), rounded to 0.1 um as in a certificate."""
    turn = np.arange(8) * np.pi / 4
    rings = [
        np.column_stack([radius * np.cos(turn + off), radius * np.sin(turn + off), np.full(8, level)])
        for radius, level, off in zip(RING_MM, LEVELS_MM, (0.0, np.pi / 8), strict=True)
    ]
    return np.asarray(np.round(middle + np.concatenate([*rings, np.zeros((1, 3))]), 4))
