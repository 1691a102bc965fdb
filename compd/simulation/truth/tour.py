"""Which points the tour visits."""

from __future__ import annotations

import numpy as np

from compd.arrays import FloatArray
from compd.errors import KinematicsError
from compd.simulation.truth.mechanism import Mechanism

# The links' stroke either way, and how far the points lie from machine zero, as shares of the links'
# length there; a hexapod's points are also turned, by up to this angle about each axis.
STROKE_SHARE = 0.3
RADIUS_SHARE = 0.2
HEIGHT_SHARE = 0.12
TURN_RAD = 0.08
POINTS = 24


def tour_points_mm(mechanism: Mechanism, rng: np.random.Generator, count: int = POINTS) -> FloatArray:
    """(count, n) scale values of points in a cylinder about machine zero, along z of {B} (or of {P}: figure 15).

    As a controller without compensation computes them: all parts as drawn.
    """
    length_mm = float(mechanism.lengths0_mm.mean())
    axes = mechanism.rotation_M_B0 if mechanism.tip_frame == "M" else np.eye(3)
    zero = mechanism.tip0_M if mechanism.tip_frame == "M" else mechanism.tip0_P
    turn_rad = TURN_RAD if len(mechanism.axes_P) == 0 else 0.0
    points: list[FloatArray] = []
    while len(points) < count:
        radius = RADIUS_SHARE * np.sqrt(rng.uniform())
        angle = rng.uniform(0, 2 * np.pi)
        height = HEIGHT_SHARE * rng.uniform(-1, 1)
        offset = length_mm * np.array([radius * np.cos(angle), radius * np.sin(angle), height])
        turn = rng.uniform(-turn_rad, turn_rad, 3)
        try:
            posture = mechanism.posture_at(zero + axes @ offset, turn)
        except KinematicsError:
            continue  # outside this machine's reach: take another
        scale_mm = mechanism.lengths(posture) - mechanism.lengths0_mm
        if np.all(np.abs(scale_mm) < STROKE_SHARE * mechanism.lengths0_mm):
            points.append(scale_mm)
    return np.array(points)
