"""Probing of a ball: the links are corrected step by step until the tip is at the ball's centre.

As a scanning probe would bring it there; the scale values reached are what the machine then measures.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from compd.arrays import FloatArray
from compd.simulation.truth.closure import Posture
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.world import World

PROBING_STEP_S = 0.5
# Each step reduces the error a thousandfold; before the first it is some ten micrometres.
STEPS = 3


def probing_steps_mm(world: World, ball: FloatArray, posture: Posture) -> Iterator[FloatArray]:
    """Scale values (n,) to go to one after another; after the last the tip is at `ball` to a nanometre.

    Each step is a Newton step with the kinematics as drawn. The caller moves the machine between two steps.

    ball : (3,) mm, in the world's `tip_frame`. posture : posture there, as drawn; its attitude is kept.
    """
    mechanism = world.mechanism
    turn_rad = _turn_rad(mechanism, posture)
    drawn_mm = mechanism.scales_at(mechanism.posture_at(ball, turn_rad))
    for _ in range(STEPS):
        error_mm = world.reference_tip_mm() - ball
        yield world.scale_mm + mechanism.scales_at(mechanism.posture_at(ball - error_mm, turn_rad)) - drawn_mm


def _turn_rad(mechanism: Mechanism, posture: Posture) -> FloatArray:
    """(3,) rotation vector in {M} from the attitude at machine zero to that of `posture`."""
    return np.asarray(Rotation.from_matrix((mechanism.posture0[1:].T @ posture[1:]).T).as_rotvec())
