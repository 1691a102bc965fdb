"""Faults: each kind begins and ends, several at once leave without the others, a person mends."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator

import numpy as np
import pytest

from tests.support.paths import CONFIG
from tests.worlds.faults import begin
from tests.worlds.faults.computer import pause
from tests.worlds.faults.fault import Fault, mend, present
from tests.worlds.faults.gauges import jump
from tests.worlds.faults.lines import cable, gateway, power
from tests.worlds.faults.machine import driven, moved_while_silent
from tests.worlds.faults.replies import lost, silent
from tests.worlds.plan import Event, draw
from tests.worlds.rates import Kind, kinds
from tests.worlds.world import BOOT_S, World, built

# Parts that a World has or has not.
PARTS = {
    "computer.killed": "kill",
    "computer.restart": "restart",
    "computer.reboot": "reboot",
    "computer.clock_set": "set_clock",
    "persons.adopt": "adopt",
    "persons.release": "release",
    "persons.reload": "reload",
}


@pytest.fixture(scope="module")
def world() -> Iterator[World]:
    with built(CONFIG / "tripod-cmm.yaml", 0) as world:
        yield world


def missing(world: World, kind: Kind) -> bool:
    part = "controller" if kind.family == "controller" else PARTS.get(f"{kind.family}.{kind.name}")
    return part is not None and not hasattr(world, part)


def drawn(kind: Kind) -> Event:
    """An event of a kind."""
    return random.Random(0).choice(draw(0, 600.0, [kind._replace(per_hour=60.0)], "tripod-cmm.yaml").events)


@pytest.mark.parametrize("kind", kinds(), ids=lambda kind: f"{kind.family}.{kind.name}")
def test_every_kind_begins_and_ends(world: World, kind: Kind) -> None:
    if missing(world, kind):
        pytest.skip("this World has no such part")
    event = drawn(kind)
    short = {name: min(value, 0.1) if name.endswith("_s") else value for name, value in event.parameters.items()}
    fault = begin(world, event.family, event.kind, event.target, short)
    world.run(0.3)
    mend(world)
    if kind.name != "zero":
        world.run(BOOT_S if kind.name in ("restart", "reboot") else 1.0)
        assert not fault.present
    for other in present(world):
        other.end()
    assert fault.ended_s < math.inf


def test_two_jumps_of_a_gauge_leave_one_by_one(world: World) -> None:
    world.run(1.0)
    world.accept()
    first, second = jump(world, "scale_1.position", 1.0, 60.0), jump(world, "scale_1.position", 10.0, 60.0)
    assert world.shown["scale_1"]("position", 0.0) == 11.0
    assert world.shown["scale_1"]("other", 0.0) == 0.0
    first.end()
    assert world.shown["scale_1"]("position", 0.0) == 10.0
    assert present(world) == [second]
    mend(world)
    assert world.shown["scale_1"]("position", 0.0) == 0.0
    assert not present(world)


def test_a_plug_is_in_again_when_the_last_outage_ends(world: World) -> None:
    wire = world.wires["scale_1"]
    one, all_lines = cable(world, "scale_1", 60.0), gateway(world, "", 60.0)
    one.end()
    assert not wire.plugged
    all_lines.end()
    assert wire.plugged


def test_lost_replies_end_by_their_count_and_silence_by_its_time(world: World) -> None:
    count, wire = 3, world.wires["scale_2"]
    fault = lost(world, "scale_2", count)
    before = wire.replies
    while fault.present:
        world.run(0.01)
    assert wire.replies == before + count
    fault = silent(world, "scale_2", 0.2)
    world.run(0.3)
    assert fault.ended_s == pytest.approx(fault.began_s + 0.2)


def test_displays_without_power_count_from_zero_until_a_person_looks(world: World) -> None:
    world.drive([1.0, 2.0, 3.0])
    world.arrive()
    fault = power(world, "scale_2", 0.1, 60.0)
    world.run(0.2)
    assert world.shown["scale_2"]("position", 2.0) == pytest.approx(0.0, abs=1e-3)
    assert fault.present
    mend(world)
    assert world.shown["scale_2"]("position", 2.0) == 2.0


def test_a_machine_departs_from_rest_while_a_scale_is_silent(world: World) -> None:
    wire, home_mm = world.wires["scale_1"], [0.0, 0.0, 0.0]
    driven(world, "", home_mm, 100.0, 1000.0)
    world.arrive()
    driven(world, "", [20.0, 20.0, 20.0], 100.0, 1000.0)
    world.run(0.1)
    fault = moved_while_silent(world, "scale_1", [2.0, 2.0, 2.0], 100.0, 1000.0, 0.05, 0.5)
    while world.moving:
        world.run(0.01)
    place_mm, answers = world.scale_mm(), wire.fault(b"1")
    assert answers
    assert np.all((place_mm > 0.1) & (place_mm < 19.0))
    world.run(0.3)
    assert not wire.fault(b"1")
    world.run(0.3)
    assert world.scale_mm() == pytest.approx(place_mm + 2.0)
    world.run(0.4)
    assert not fault.present
    assert wire.fault(b"1")


def test_links_that_move_stop_within_their_stroke_whatever_their_next_drive_is(world: World) -> None:
    home_mm = [0.0, 0.0, 0.0]
    driven(world, "", home_mm, 500.0, 3000.0)
    world.arrive()
    driven(world, "", [20.0, 20.0, 20.0], 500.0, 3000.0)
    world.run(0.1)
    driven(world, "", home_mm, 10.0, 100.0)
    largest_mm = 0.0
    while world.moving:
        largest_mm = max(largest_mm, float(world.scale_mm().max()))
        world.run(0.01)
    assert largest_mm < 40.0
    assert world.scale_mm() == pytest.approx(home_mm)


def test_a_pause_suspects_no_gauge_and_a_restart_suspects_each(world: World) -> None:
    assert pause(world, "", 0.01).suspects == ()
    assert Fault(world).suspects == ("",)
    assert lost(world, "scale_1", 1).suspects == ("scale_1", "scale_1")
