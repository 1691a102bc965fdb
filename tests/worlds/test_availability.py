"""How much of the time setpoints are valid on the move, beside faults that pass: in virtual time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from compd.setpoint_states import State
from compd.simulation.truth.motion import Drives
from tests.support.paths import CONFIG
from tests.worlds.faults.computer import keep_busy
from tests.worlds.faults.replies import lost as replies_lost
from tests.worlds.faults.wiring import line_of, scales
from tests.worlds.world import World, built

MACHINES = ("tripod-cmm.yaml", pytest.param("hexapod.yaml", marks=pytest.mark.long))
SEEDS = [0, *(pytest.param(seed, marks=pytest.mark.long) for seed in range(1, 20))]
REACH_MM = 40.0
JUDGED_S = 5.0


def drive_until(world: World, rng: np.random.Generator, end_s: float) -> None:
    """From one place to the next without a rest."""
    while world.hub.now_s < end_s:
        world.drive(rng.uniform(-REACH_MM, REACH_MM, len(world.scale_mm())))
        while world.moving and world.hub.now_s < end_s:
            world.run(min(0.02, end_s - world.hub.now_s))


def after(name: str, seed: int, fault: Callable[[World, str], float]) -> World:
    """A world that drives; `fault` happens to one of its scales on the way, and returns when it has ended, s."""
    with built(CONFIG / name, seed) as world:
        rng = np.random.default_rng(seed)
        drive_until(world, rng, world.hub.now_s + 1.0 + rng.random())
        end_s = fault(world, str(rng.choice(scales(world))))
        drive_until(world, rng, end_s)
        world.forget()
        drive_until(world, rng, end_s + JUDGED_S)
    assert not [told for told in world.told if told.valid and told.error_um > 3.0 * told.u_tip_um]
    return world


def valid_share(world: World) -> float:
    return sum(told.valid for told in world.told) / len(world.told)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", MACHINES)
@pytest.mark.parametrize(
    ("count", "share"),
    [pytest.param(1, 0.97, marks=pytest.mark.long), pytest.param(2, 0.95, marks=pytest.mark.long), (3, 0.90)],
)
def test_lost_replies_cost_little(name: str, count: int, share: float, seed: int) -> None:
    def lost(world: World, gauge: str) -> float:
        replies_lost(world, line_of(world, gauge), count)
        return world.hub.now_s

    assert valid_share(after(name, seed, lost)) >= share


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", MACHINES)
@pytest.mark.parametrize(
    "paused_s", [pytest.param(0.2, marks=pytest.mark.long), 0.4, pytest.param(1.0, marks=pytest.mark.long)]
)
def test_after_a_pause_of_the_computer_setpoints_are_valid_again_at_once(name: str, paused_s: float, seed: int) -> None:
    def paused(world: World, _: str) -> float:
        world.pause(paused_s)
        return world.hub.now_s + paused_s

    world = after(name, seed, paused)
    begins_s = world.told[0].time_s
    assert all(told.valid for told in world.told if told.time_s > begins_s + 0.1)


@pytest.mark.parametrize("speed", [pytest.param(20.0, marks=pytest.mark.long), 140.0])
@pytest.mark.parametrize("name", MACHINES)
def test_without_a_fault_every_setpoint_is_valid(name: str, speed: float) -> None:
    with built(CONFIG / name, 1, Drives(speed)) as world:
        world.forget()
        drive_until(world, np.random.default_rng(1), world.hub.now_s + 4.0)
        assert valid_share(world) == 1.0


def works_beside_a_busy_computer(name: str, seed: int, stalls_every_s: float, works_s: float) -> float:
    """Share of valid setpoints of a machine that goes from place to place; no state waits for a person."""
    with built(CONFIG / name, seed) as world:
        rng = np.random.default_rng(seed)
        keep_busy(world, stalls_every_s)
        world.forget()
        end_s = world.hub.now_s + works_s
        while world.hub.now_s < end_s:
            world.drive(rng.uniform(-REACH_MM, REACH_MM, len(world.scale_mm())))
            world.arrive()
            world.run(rng.uniform(0.0, 2.0))
        assert State.FAULT not in {told.state for told in world.told}
        return valid_share(world)


@pytest.mark.long
@pytest.mark.sample
def test_many_stalls_of_the_computer_cost_the_setpoints_of_their_own_time() -> None:
    """They take 0.16 s in the mean, every 3 s."""
    assert works_beside_a_busy_computer("tripod-cmm.yaml", 0, 3.0, 20.0) >= 0.9


@pytest.mark.long
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("name", ["tripod-cmm.yaml", "hexapod.yaml"])
def test_ten_minutes_beside_a_busy_computer(name: str, seed: int) -> None:
    assert works_beside_a_busy_computer(name, seed, 60.0, 600.0) >= 0.99
