"""What was valid and wrong once, on the shipped machines in virtual time; `long` draws more of each."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from compd.simulation.truth.motion import DRIVES, Drives
from tests.support.paths import CONFIG
from tests.worlds.faults.gauges import lose_counts, shift
from tests.worlds.faults.lines import cable
from tests.worlds.faults.replies import silent
from tests.worlds.faults.wiring import line_of, scales
from tests.worlds.world import World, built

MACHINES = ("tripod-cmm.yaml", "hexapod.yaml")
# A valid setpoint may be wrong by so many times its bound: that holds 95 % of them.
MOST = 3.0
SEEDS = [0, *(pytest.param(seed, marks=pytest.mark.long) for seed in range(1, 20))]
FAST = Drives(500.0, 3333.0)
FAST_MM_PER_S2 = 4000.0
Fault = Callable[[World, np.random.Generator], float]


def silent_until_the_drive_has_ended(world: World, rng: np.random.Generator) -> float:
    """One scale, read at rest, says nothing while all links drive and stop, nor when the others stand again."""
    place_mm = begin(world, rng, 6.0)
    silent(world, line_of(world, str(rng.choice(scales(world)))), rng.uniform(0.45, 0.7))
    world.drive(place_mm - np.sign(place_mm) * rng.uniform(3.0, 8.0))
    world.run(0.1)  # the bound leaves out the departure of a machine that has rested for long
    since_s = world.forget()
    world.arrive()
    world.run(1.0)
    return since_s


def moved_while_all_scales_were_away(world: World, rng: np.random.Generator) -> float:
    """They come back with the counts that they had."""
    place_mm = begin(world, rng, 6.0)
    since_s, was_mm = world.forget(), world.scale_mm()
    for gauge in scales(world):
        cable(world, line_of(world, gauge), 2.0)
    world.run(0.1)
    world.drive(place_mm - np.sign(place_mm) * rng.uniform(3.0, 15.0))
    world.arrive()
    lose_counts(world, was_mm)
    world.run(3.5)
    return since_s


def jumped_in_fast_motion(world: World, rng: np.random.Generator) -> float:
    """Two answers of a moving part differ by its motion, so that they do not agree on a jump by themselves."""
    place_mm = begin(world, rng, 40.0)
    world.drive(-place_mm / np.abs(place_mm).max() * rng.uniform(30.0, 60.0))
    world.run(rng.uniform(0.03, 0.1))
    since_s = world.forget()
    shift(world, str(rng.choice(scales(world))), float(rng.choice([-1.0, 1.0]) * rng.uniform(2.0, 8.0)))
    world.run(1.5)
    return since_s


def begin(world: World, rng: np.random.Generator, reach_mm: float) -> np.ndarray:
    """Somewhere, at rest for a second."""
    place_mm = rng.uniform(-reach_mm, reach_mm, len(world.scale_mm()))
    world.drive(place_mm)
    world.arrive()
    world.run(1.0)
    return place_mm


def drives_faster(document: dict[str, Any]) -> None:
    for wire in document["wiring"]["scale"]:
        document["gauges"][wire["gauge"]]["acceleration_mm_per_s2"] = FAST_MM_PER_S2


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", MACHINES)
@pytest.mark.parametrize(
    "fault",
    [silent_until_the_drive_has_ended, moved_while_all_scales_were_away, jumped_in_fast_motion],
    ids=lambda fault: fault.__name__,
)
def test_no_valid_setpoint_is_far_beyond_its_bound(fault: Fault, name: str, seed: int) -> None:
    is_fast = fault is jumped_in_fast_motion
    with built(CONFIG / name, seed, FAST if is_fast else DRIVES, drives_faster if is_fast else lambda _: None) as world:
        since_s = fault(world, np.random.default_rng(seed))
        wrong = [told for told in world.told if told.valid and told.error_um > MOST * told.u_tip_um]
    assert not wrong, (len(wrong), wrong[0].time_s - since_s, wrong[0])
