"""The machine's workspace: stroke of the links, points within it, and the posture at given scale values."""

from __future__ import annotations

import numpy as np

from compd.arrays import FloatArray
from compd.errors import KinematicsError
from compd.simulation.truth.closure import Posture
from compd.simulation.truth.mechanism import Mechanism

# Radius and half height of the cylinder that points are drawn in: as shares of the
# links' mean length at machine zero. A hexapod's points are also turned by up to TURN_RAD about each axis.
RADIUS_SHARE = 0.2
HEIGHT_SHARE = 0.12
TURN_RAD = 0.08
POINTS = 24


def draw_points_mm(mechanism: Mechanism, rng: np.random.Generator, count: int = POINTS) -> FloatArray:
    """(count, m) scale values of random points in a cylinder about machine zero.

    The cylinder's axis is z of {B}, or of {P} with the tool on the plate. Scale values are those of a controller
    without compensation: all parts as drawn. Points beyond reach or stroke are drawn again.
    """
    length_mm = float(mechanism.lengths0_mm.mean())
    axes = mechanism.rotation_M_B0 if mechanism.tip_frame == "M" else np.eye(3)
    zero = mechanism.tip0_M if mechanism.tip_frame == "M" else mechanism.tip0_P
    turn_rad = TURN_RAD if mechanism.turned.any() else 0.0
    points: list[FloatArray] = []
    while len(points) < count:
        radius = RADIUS_SHARE * np.sqrt(rng.uniform())
        angle = rng.uniform(0, 2 * np.pi)
        height = HEIGHT_SHARE * rng.uniform(-1, 1)
        offset = length_mm * np.array([radius * np.cos(angle), radius * np.sin(angle), height])
        turn = rng.uniform(-turn_rad, turn_rad, 3) * mechanism.turned
        try:
            posture = mechanism.posture_at(zero + axes @ offset, turn)
        except KinematicsError:
            continue
        scale_mm = mechanism.scales_at(posture)
        if np.all(np.abs(scale_mm) < mechanism.stroke_mm):
            points.append(scale_mm)
    return np.array(points)


def posture_at_scales(mechanism: Mechanism, scale_mm: FloatArray) -> Posture:
    """Posture at scale values (m,) with all parts as drawn, followed in eight steps from machine zero."""
    posture = mechanism.posture0
    for share in np.linspace(0.0, 1.0, 9)[1:]:
        posture = mechanism.posture_of(share * scale_mm, posture)
    return posture
