"""Compiled parts of `compd.simulation.truth.joints`: the angles of joints, and the runout of their balls."""

from __future__ import annotations

import math

from numba import float64

from compd.arrays import FloatArray
from compd.jit import ROW_MATRICES, ROWS, loop


@loop([ROW_MATRICES, ROWS, ROWS])
def find_angles(triads: FloatArray, directions: FloatArray, angles_rad: FloatArray) -> None:
    """(n, 2) angles by which links of directions (n, 3) have turned away from their triads (n, 3, 3)."""
    for i in range(len(triads)):
        along = 0.0
        for d in range(3):
            along += triads[i, 0, d] * directions[i, d]
        for k in range(2):
            across = 0.0
            for d in range(3):
                across += triads[i, 1 + k, d] * directions[i, d]
            angles_rad[i, k] = math.atan2(across, along)


@loop([float64[:, :, :, ::1], float64[:, :, :, ::1], ROWS, ROWS])
def add_waves(amplitude_mm: FloatArray, phase_rad: FloatArray, angles_rad: FloatArray, wave_mm: FloatArray) -> None:
    """Add the harmonics of both angles (n, 2) of each joint to its displacement (n, 3).

    amplitude_mm, phase_rad : (n, 3, harmonics, 2).
    """
    joints, directions, harmonics, both = amplitude_mm.shape
    for i in range(joints):
        for d in range(directions):
            for h in range(harmonics):
                for k in range(both):
                    turned_rad = (h + 1) * angles_rad[i, k] + phase_rad[i, d, h, k]
                    wave_mm[i, d] += amplitude_mm[i, d, h, k] * math.cos(turned_rad)
