"""Compiled parts of `compd.simulation.truth.joints`: the angles of joints, and the runout of their balls."""

from __future__ import annotations

import math

import numpy as np
from numba import float64

from compd.arrays import FloatArray
from compd.jit import NUMBERS, ROW_MATRICES, ROWS, SCALAR, helper, loop

# (n, 3, harmonics, 2) of each joint, direction, harmonic and angle.
HARMONICS = float64[:, :, :, ::1]


@helper
def _angles(triads: FloatArray, directions: FloatArray, angles_rad: FloatArray) -> None:
    for i in range(len(triads)):
        along = 0.0
        for d in range(3):
            along += triads[i, 0, d] * directions[i, d]
        for k in range(2):
            across = 0.0
            for d in range(3):
                across += triads[i, 1 + k, d] * directions[i, d]
            angles_rad[i, k] = math.atan2(across, along)


@helper
def _waves(amplitude_mm: FloatArray, phase_rad: FloatArray, angles_rad: FloatArray, wave_mm: FloatArray) -> None:
    joints, directions, harmonics, both = amplitude_mm.shape
    for i in range(joints):
        for d in range(directions):
            for h in range(harmonics):
                for k in range(both):
                    turned_rad = (h + 1) * angles_rad[i, k] + phase_rad[i, d, h, k]
                    wave_mm[i, d] += amplitude_mm[i, d, h, k] * math.cos(turned_rad)


@loop([ROW_MATRICES, ROWS, ROWS])
def find_angles(triads: FloatArray, directions: FloatArray, angles_rad: FloatArray) -> None:
    """(n, 2) angles by which links of directions (n, 3) have turned away from their triads (n, 3, 3)."""
    _angles(triads, directions, angles_rad)


@loop([HARMONICS, HARMONICS, ROWS, ROWS])
def add_waves(amplitude_mm: FloatArray, phase_rad: FloatArray, angles_rad: FloatArray, wave_mm: FloatArray) -> None:
    """Add the harmonics of both angles (n, 2) of each joint to its displacement (n, 3).

    amplitude_mm, phase_rad : (n, 3, harmonics, 2).
    """
    _waves(amplitude_mm, phase_rad, angles_rad, wave_mm)


@loop([ROW_MATRICES, ROWS, HARMONICS, HARMONICS, ROWS, NUMBERS, ROWS, SCALAR, SCALAR, NUMBERS, ROWS])
def displace(
    triads: FloatArray,
    directions: FloatArray,
    amplitude_mm: FloatArray,
    phase_rad: FloatArray,
    at_zero_mm: FloatArray,
    axial_N: FloatArray,
    lateral_N: FloatArray,
    along_mm_per_N: float,
    across_mm_per_N: float,
    along_mm: FloatArray,
    across_mm: FloatArray,
) -> None:
    """Displacements of n balls by runout and forces: (n,) along the links and (n, 3) across, in the triads' frame.

    axial_N (n,), lateral_N (n, 3) : forces on the balls. at_zero_mm : (n, 3) runout at machine zero.
    """
    angles_rad, runout_mm = np.empty((len(triads), 2)), np.zeros((len(triads), 3))
    _angles(triads, directions, angles_rad)
    _waves(amplitude_mm, phase_rad, angles_rad, runout_mm)
    for i in range(len(triads)):
        along_mm[i] = runout_mm[i, 0] - at_zero_mm[i, 0] + along_mm_per_N * axial_N[i]
        for d in range(3):
            across_mm[i, d] = across_mm_per_N * lateral_N[i, d]
            for k in range(1, 3):
                across_mm[i, d] += (runout_mm[i, k] - at_zero_mm[i, k]) * triads[i, k, d]
