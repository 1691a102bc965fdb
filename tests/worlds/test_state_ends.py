"""The times in which states end, as the reference has them, hold for the shipped machines."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

from compd.configuration import load
from compd.live.machine import MachineZero
from compd.setpoint_states import State
from docs.generate.state_ends import ENDS, Cause, cause_of_silence, state_within_s, within_s
from tests.support.paths import CONFIG
from tests.worlds.faults.gauges import shift
from tests.worlds.faults.lines import cable
from tests.worlds.faults.replies import silent
from tests.worlds.faults.wiring import line_of, scales
from tests.worlds.world import World, built

SETTLED_S = 0.5
BACK = (State.OK, State.SLEWING)
MACHINES = ("tripod-cmm.yaml", pytest.param("hexapod.yaml", marks=pytest.mark.long))


def stand_somewhere(world: World) -> None:
    """Beside machine zero, at which a scale that restarts shows what it showed."""
    world.drive([5.0 + link for link in range(len(world.scale_mm()))])
    world.arrive()
    world.run(1.2)


def ended_after_s(world: World, end_s: float, at_most_s: float) -> float:
    """Time (s) from `end_s` to the last setpoint that is not as before, when it has been so for long enough."""
    last_s = end_s
    while world.hub.now_s < end_s + at_most_s + 2 * SETTLED_S:
        world.run(0.1)
        last_s = max([last_s, *(told.time_s for told in world.told if told.state not in BACK)])
        if world.hub.now_s > max(last_s, end_s) + SETTLED_S:
            return last_s - end_s
    return math.inf


def ends_in_time(world: World, cause: Cause, gauge: str, lasts_s: float, begin: Callable[[], object]) -> None:
    """Play a cause at a machine that stands, and see how long it goes on after its end."""
    at_most_s = within_s(world.configuration, cause, False, [gauge] if gauge else [], lasts_s)
    world.forget()
    end_s = world.hub.now_s + lasts_s
    begin()
    world.run(lasts_s)
    took_s = ended_after_s(world, end_s, at_most_s)
    assert took_s <= at_most_s, (cause, gauge, lasts_s, world.told[-1])


@pytest.mark.parametrize("name", MACHINES)
@pytest.mark.parametrize(
    "kind", ["scale", *(pytest.param(kind, marks=pytest.mark.long) for kind in ("joint", "frame", "cabinet"))]
)
def test_a_gauge_that_is_back_is_believed_in_time(name: str, kind: str) -> None:
    with built(CONFIG / name, 1) as world:
        stand_somewhere(world)
        gauge = next(each for each in world.configuration.gauges if each.startswith(kind))
        line = line_of(world, gauge)
        for silent_s in (0.1, 1.2):
            cause = cause_of_silence(world.configuration, gauge, silent_s)
            ends_in_time(world, cause, gauge, silent_s, partial(silent, world, line, silent_s))
        ends_in_time(world, Cause.LINE, gauge, 1.3, lambda: cable(world, line, 1.3))


@pytest.mark.parametrize("name", MACHINES)
def test_the_daemon_is_back_in_time(name: str) -> None:
    with built(CONFIG / name, 2) as world:
        stand_somewhere(world)
        for pause_s in (0.3, 2.0):
            ends_in_time(world, Cause.PAUSED, "", pause_s, partial(world.pause, pause_s))

        ends_in_time(world, Cause.ACQUISITION, "", 0.0, world.kill_acquisition)
        world.stop()
        world.run(1.5)
        ends_in_time(world, Cause.STARTED, "", 0.0, world.start)


@pytest.mark.parametrize("name", MACHINES)
def test_a_correction_arrives_in_time(name: str) -> None:
    with built(CONFIG / name, 3) as world:
        stand_somewhere(world)
        zero = world.zero
        readings_mm = {
            channel: mm + (0.05 if channel.startswith("joints") else 0.0) for channel, mm in zero.readings_mm.items()
        }
        world.forget()
        assert world.daemon is not None
        world.daemon.commands.zero = MachineZero(zero.zero_hash, zero.taken_at, readings_mm)
        world.run(within_s(world.configuration, Cause.CORRECTION))
        assert State.SLEWING in {told.state for told in world.told}
        assert world.told[-1].state is State.OK


def test_a_thermometer_that_is_right_again_is_believed_in_time() -> None:
    with built(CONFIG / "tripod-cmm.yaml", 4) as world:
        assert world.daemon is not None
        trust = world.daemon.trust
        channel = trust.index["cabinet.link_1"]
        before = dict(world.shown)
        shift(world, "cabinet", lambda name, degC: degC + (5.0 if name == "link_1" else 0.0))
        world.run(3.0)
        assert trust.doubt[channel] != 0
        world.shown.clear()
        world.shown.update(before)
        world.run(within_s(world.configuration, Cause.QUANTITY, gauges=["cabinet"]))
        assert trust.doubt[channel] == 0


@pytest.mark.parametrize("name", MACHINES)
def test_on_the_move_what_the_limits_of_motion_judge_ends_in_time(name: str) -> None:
    with built(CONFIG / name, 5) as world:
        rng, gauge = np.random.default_rng(5), scales(world)[-1]

        def drive(duration_s: float) -> None:
            end_s = world.hub.now_s + duration_s
            while world.hub.now_s < end_s:
                if not world.moving:
                    world.drive(rng.uniform(-40.0, 40.0, len(world.scale_mm())).tolist())
                world.run(0.02)

        configuration = world.configuration
        assert cause_of_silence(configuration, gauge, 0.1) is Cause.BRIEF
        for cause, lasts_s, begin in (
            (Cause.BRIEF, 0.1, lambda: silent(world, line_of(world, gauge), 0.1)),
            (Cause.PAUSED, 0.3, lambda: world.pause(0.3)),
            (Cause.ACQUISITION, 0.0, world.kill_acquisition),
        ):
            drive(1.5)
            begin()
            drive(lasts_s + within_s(configuration, cause, moving=True, gauges=[gauge] if cause is Cause.BRIEF else []))
            world.forget()
            drive(0.5)
            assert {told.state for told in world.told} == {State.OK}, cause


def test_without_a_scale_that_stayed_a_person_is_asked_for() -> None:
    with built(CONFIG / "tripod-cmm.yaml", 6) as world:
        stand_somewhere(world)
        for gauge in scales(world):
            silent(world, line_of(world, gauge), 1.0)
        world.run(1.0 + within_s(world.configuration, Cause.SILENT, gauges=scales(world)))
        assert world.told[-1].state is State.FAULT
        assert within_s(world.configuration, Cause.ALL_SCALES) == math.inf


def test_every_state_but_ok_ends_and_every_cause_has_a_row() -> None:
    assert [end.cause for end in ENDS] == list(Cause)
    configuration = load(CONFIG / "tripod-cmm.yaml")
    for state in State:
        assert bool(state_within_s(configuration, state)) is (state is not State.OK)
    assert within_s(configuration, Cause.WRONG) == math.inf
    short_s, long_s = (within_s(configuration, Cause.LINE, gauges=["cabinet"], lasted_s=s) for s in (0.2, 100.0))
    assert long_s - short_s == pytest.approx(10.0 - 0.7)
