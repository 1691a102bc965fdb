"""Touching a ball: the links feel their way until the tip is where the ball is."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from compd.arrays import FloatArray
from compd.simulation.truth.closure import Posture
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.world import World

TOUCH_STEP_S = 0.5
# Each step takes the error down a thousandfold; the first is some ten micrometres.
STEPS = 3


def approach(world: World, ball: FloatArray, posture: Posture) -> Iterator[FloatArray]:
    """Scale values (n,), to go to one after another: after the last the tip is at `ball` to a nanometre.

    ball : (3,) mm, in the world's `tip_frame`. posture : the drawing's posture there, for the attitude.
    """
    machine = world.mechanism
    turn_rad = _turn_rad(machine, posture)
    here_mm = machine.lengths(machine.posture_at(ball, turn_rad))
    for _ in range(STEPS):
        missed_mm = world.shown_mm() - ball
        yield world.scale_mm + machine.lengths(machine.posture_at(ball - missed_mm, turn_rad)) - here_mm


def touch(world: World, ball: FloatArray) -> Posture:
    """Go to `ball`, as drawn at first, and touch it with the attitude of machine zero; the posture as drawn there."""
    machine = world.mechanism
    posture = machine.posture_at(ball, np.zeros(3))
    world.carry(machine.lengths(posture) - machine.lengths0_mm, posture, 4 * TOUCH_STEP_S, 2 * TOUCH_STEP_S)
    for scale_mm in approach(world, ball, posture):
        world.carry(scale_mm, posture, TOUCH_STEP_S, TOUCH_STEP_S / 2)
    return posture


def posture_at_scales(mechanism: Mechanism, scale_mm: FloatArray) -> Posture:
    """The drawing's posture at scale values (n,), found in small steps from machine zero."""
    posture = mechanism.posture0
    for share in np.linspace(0.0, 1.0, 9)[1:]:
        lengths_mm = mechanism.lengths0_mm + share * scale_mm
        posture = mechanism.closure.by_lengths(mechanism.joints0_M, mechanism.joints_P, lengths_mm, posture)
    return posture


def _turn_rad(mechanism: Mechanism, posture: Posture) -> FloatArray:
    """(3,) rotation vector in {M} from the attitude at machine zero."""
    return np.asarray(Rotation.from_matrix((mechanism.posture0[1:].T @ posture[1:]).T).as_rotvec())
