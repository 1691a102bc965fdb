"""Fixed balls and pins in the simulated machine's workspace, and where the tip goes to measure at them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.errors import KinematicsError
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.workspace import HEIGHT_SHARE, RADIUS_SHARE, TURN_RAD

# Nominal length of the ballbar, mm: the shortest that is sold, which a machine of half a metre can carry around.
BALLBAR_MM = 100.0
# Excess (mm) of its true over its nominal length: it is not calibrated.
BALLBAR_ERROR_MM = 0.008
# A calibrated ball of 25 mm, and the ball of the probe that touches it.
TOUCHED_RADIUS_MM = 12.5
PROBE_RADIUS_MM = 2.0
BALLS, POINTS_PER_BALL = 3, 16
PINS, ATTITUDES_PER_PIN = 3, 12
# Share of the workspace's radius on which pins and touched balls stand.
RING_SHARE = 0.6


@dataclass(frozen=True)
class FixedPlaces:
    """Positions of fixed objects that are touched or measured from.

    end_M : (E, 3) balls or pins. end_of_point : (P,) index of the end of each of the plan's points.
    tip_M : (P, 3) where the tip is nominally. scale_mm : (P, n) for that, as a controller without compensation knows.
    touched : whether the machine is led to the place by touch, so that the tip is there truly.
    length_error_mm : by how much a bar is longer than it says.
    """

    end_M: FloatArray
    end_of_point: IntArray
    tip_M: FloatArray
    scale_mm: FloatArray
    touched: bool
    length_error_mm: float = 0.0


def ballbar_places(mechanism: Mechanism, rng: np.random.Generator) -> FixedPlaces:
    """Three balls below the middle of the workspace, and the tip at random on the sphere about each."""
    length_mm = float(mechanism.lengths0_mm.mean())
    below = np.array([0.0, 0.0, -0.5 * HEIGHT_SHARE * length_mm])
    ends_M = [mechanism.tip0_M + below + rng.uniform(-20.0, 20.0, 3) for _ in range(BALLS)]

    def around(end: int) -> FloatArray:
        return np.asarray(ends_M[end] + BALLBAR_MM * _direction(rng))

    return _places(mechanism, rng, np.array(ends_M), around, POINTS_PER_BALL, False, BALLBAR_ERROR_MM)


def touched_ball_places(mechanism: Mechanism, rng: np.random.Generator) -> FixedPlaces:
    """A calibrated ball at three places of the workspace, touched from random directions above its equator."""
    ends_M = _ring(mechanism, BALLS)

    def touching(end: int) -> FloatArray:
        direction = _direction(rng)
        direction[2] = abs(direction[2])
        return np.asarray(ends_M[end] + (TOUCHED_RADIUS_MM + PROBE_RADIUS_MM) * direction)

    return _places(mechanism, rng, ends_M, touching, POINTS_PER_BALL, True)


def pin_places(mechanism: Mechanism, rng: np.random.Generator) -> FixedPlaces:
    """Three pins at different heights, each of which a hexapod reaches with twelve attitudes."""
    ends_M = _ring(mechanism, PINS)
    count = ATTITUDES_PER_PIN if mechanism.turned.any() else 1
    return _places(mechanism, rng, ends_M, lambda end: ends_M[end].copy(), count, True)


def _ring(mechanism: Mechanism, count: int) -> FloatArray:
    """(count, 3) places around the middle of the workspace, one higher than the other."""
    length_mm = float(mechanism.lengths0_mm.mean())
    angle = 2 * np.pi * np.arange(count) / count
    radius_mm = RING_SHARE * RADIUS_SHARE * length_mm
    height_mm = np.linspace(-0.5, 0.5, count) * HEIGHT_SHARE * length_mm
    return np.asarray(
        mechanism.tip0_M + np.column_stack([radius_mm * np.cos(angle), radius_mm * np.sin(angle), height_mm])
    )


def _direction(rng: np.random.Generator) -> FloatArray:
    vector = rng.standard_normal(3)
    return np.asarray(vector / np.linalg.norm(vector))


def _places(
    mechanism: Mechanism,
    rng: np.random.Generator,
    ends_M: FloatArray,
    draw_tip_M: Callable[[int], FloatArray],
    count: int,
    touched: bool,
    length_error_mm: float = 0.0,
) -> FixedPlaces:
    """`count` points at each end; a place beyond the workspace or the stroke of a link is drawn again."""
    length_mm = float(mechanism.lengths0_mm.mean())
    turn_rad = TURN_RAD if mechanism.turned.any() else 0.0
    end_of_point, tips_M, scales_mm = [], [], []
    for end in range(len(ends_M)):
        found = 0
        while found < count:
            tip_M = draw_tip_M(end)
            away_mm = tip_M - mechanism.tip0_M
            if np.hypot(*away_mm[:2]) > RADIUS_SHARE * length_mm or abs(away_mm[2]) > HEIGHT_SHARE * length_mm:
                continue
            try:
                posture = mechanism.posture_at(tip_M, rng.uniform(-turn_rad, turn_rad, 3) * mechanism.turned)
            except KinematicsError:
                continue
            scale_mm = mechanism.scales_at(posture)
            if np.any(np.abs(scale_mm) >= mechanism.stroke_mm):
                continue
            end_of_point.append(end)
            tips_M.append(tip_M)
            scales_mm.append(scale_mm)
            found += 1
    return FixedPlaces(ends_M, np.array(end_of_point), np.array(tips_M), np.array(scales_mm), touched, length_error_mm)
