"""Links that follow a controller's stream of commands: they go where it says, and the stream's pauses make no jump."""

from __future__ import annotations

import numpy as np
import pytest

from compd.arrays import FloatArray
from compd.errors import CompdError
from compd.simulation.truth.follow_motion import CATCH_UP, DELAY_S, FollowMotion, MotorCommand
from compd.simulation.truth.world import World
from tests.support.simulated import hexapod, wiring

STEP_S = 0.005
SPEED_MM_PER_S = 20.0


def ramp(start_s: float, end_s: float) -> list[MotorCommand]:
    """Commands of a link at constant speed, one every 5 ms."""
    times_s = np.arange(start_s, end_s - 1e-9, STEP_S)
    return [MotorCommand(float(time_s), np.array([SPEED_MM_PER_S * time_s])) for time_s in times_s]


def played(motion: FollowMotion, duration_s: float, step_s: float = 0.001) -> FloatArray:
    positions_mm = []
    for _ in range(round(duration_s / step_s)):
        motion.advance(step_s)
        positions_mm.append(motion.position_mm[0])
    return np.array(positions_mm)


def test_without_commands_it_stands() -> None:
    motion = FollowMotion(np.array([3.0]))
    assert motion.advance(1.0) == 0.0
    assert motion.position_mm == [3.0]
    assert motion.phase == "dwelling"


def test_an_even_stream_in_bursts_is_an_even_motion_with_a_delay() -> None:
    motion = FollowMotion(np.array([0.0]))
    positions_mm = []
    for number in range(100):
        motion.follow(ramp(0.02 * number, 0.02 * (number + 1)))
        positions_mm += played(motion, 0.02).tolist()
    speeds = np.diff(positions_mm[500:]) / 0.001
    np.testing.assert_allclose(speeds, SPEED_MM_PER_S, rtol=0.02)
    assert motion.phase == "moving"
    behind_s = 2.0 - positions_mm[-1] / SPEED_MM_PER_S
    assert 0.5 * DELAY_S <= behind_s <= 1.5 * DELAY_S


def test_a_pause_of_the_stream_slows_the_motion_down_and_makes_no_jump() -> None:
    motion = FollowMotion(np.array([0.0]))
    motion.follow(ramp(0.0, 1.0))
    before_mm = played(motion, 0.9)
    paused_mm = played(motion, 0.4)
    motion.follow(ramp(1.0, 3.0))
    after_mm = played(motion, 2.5)
    path_mm = np.concatenate([before_mm, paused_mm, after_mm])
    steps_mm = np.diff(path_mm)
    assert steps_mm.min() >= 0.0
    assert steps_mm.max() <= SPEED_MM_PER_S * CATCH_UP * 0.001 * 1.01
    assert path_mm[-1] == pytest.approx(SPEED_MM_PER_S * 2.995)


def test_it_comes_to_rest_where_the_last_command_is() -> None:
    motion = FollowMotion(np.array([0.0]))
    motion.follow(ramp(0.0, 0.5))
    end_mm = SPEED_MM_PER_S * 0.495
    motion.follow([MotorCommand(0.5 + STEP_S * k, np.array([end_mm])) for k in range(200)])
    played(motion, 1.6)
    assert motion.position_mm[0] == pytest.approx(end_mm)
    assert motion.phase == "dwelling"


def test_a_controller_that_starts_anew_begins_a_new_stream() -> None:
    motion = FollowMotion(np.array([0.0]))
    motion.follow(ramp(50.0, 50.5))
    played(motion, 1.0)
    here_mm = motion.position_mm
    motion.follow([MotorCommand(0.005 * k, here_mm) for k in range(100)])
    played(motion, 0.5)
    np.testing.assert_array_equal(motion.position_mm, here_mm)


@pytest.mark.parametrize("scale_mm", [[1.0] * 5, [1e6] * 6, [np.nan] * 6])
def test_a_world_refuses_what_no_link_can_do(scale_mm: list[float]) -> None:
    world = World(hexapod(), wiring(), 1, zero_hold_s=10.0)
    with pytest.raises(CompdError):
        world.follow([MotorCommand(0.0, np.zeros(6)), MotorCommand(0.1, np.array(scale_mm))])
    assert world.mode == "zero"


def test_a_world_follows_and_its_scales_show_it() -> None:
    world = World(hexapod(), wiring(), 1, zero_hold_s=10.0)
    world.follow([MotorCommand(0.01 * k, np.full(6, 0.02 * k)) for k in range(101)])
    for _ in range(30):
        world.advance(0.05)
    assert world.mode == "following"
    np.testing.assert_allclose(world.scale_mm, 2.0)
    assert world.sense_scale("scale_3") == pytest.approx(2.0, abs=1e-4)
    # another kind of motion takes over
    world.command([0.0] * 6)
    world.advance(5.0)
    np.testing.assert_allclose(world.scale_mm, 0.0, atol=1e-9)
