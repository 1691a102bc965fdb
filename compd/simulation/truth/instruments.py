"""Reference instruments: their noise and outliers, and the certificate of a ball plate."""

from __future__ import annotations

from typing import Literal

import numpy as np

from compd.arrays import FloatArray

# Standard uncertainty per axis: three-beam laser tracking at half a metre; a plane-mirror interferometer.
TRACKER_SIGMA_UM = 0.15
INTERFEROMETER_SIGMA_UM = 0.05
UM = 1e-3
# Size of an outlier (a beam cut or scattered), in sigmas.
OUTLIER_SIGMAS = (8.0, 40.0)

Kind = Literal["tracker", "interferometer", "ball_plate"]
SIGMA_UM = {"tracker": TRACKER_SIGMA_UM, "interferometer": INTERFEROMETER_SIGMA_UM, "ball_plate": TRACKER_SIGMA_UM}

# A 3D ball plate: two rings of eight balls, the upper one turned by half a step, and one ball in the middle.
BALLS = 17
RING_MM = (75.0, 45.0)
LEVELS_MM = (-30.0, 25.0)


def noisy(value_mm: FloatArray, sigma_um: float, rng: np.random.Generator, outlier_share: float = 0.0) -> FloatArray:
    """(m,) with normal noise; with probability `outlier_share` one coordinate is an outlier."""
    shown = value_mm + sigma_um * UM * rng.standard_normal(value_mm.shape)
    if rng.uniform() < outlier_share:
        off = rng.uniform(*OUTLIER_SIGMAS) * rng.choice([-1.0, 1.0])
        shown[rng.integers(len(shown))] += off * sigma_um * UM
    return np.asarray(shown)


def ball_plate_mm(middle: FloatArray) -> FloatArray:
    """(17, 3) calibrated centres of the balls about `middle` (3,), rounded to 0.1 um as in a certificate."""
    turn = np.arange(8) * np.pi / 4
    rings = [
        np.column_stack([radius * np.cos(turn + off), radius * np.sin(turn + off), np.full(8, level)])
        for radius, level, off in zip(RING_MM, LEVELS_MM, (0.0, np.pi / 8), strict=True)
    ]
    return np.asarray(np.round(middle + np.concatenate([*rings, np.zeros((1, 3))]), 4))
