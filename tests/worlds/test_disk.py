"""A disk that is full, hangs, is read-only or was torn by a power cut: what is lost is said, and nothing else is."""

from __future__ import annotations

import pytest

from compd.live.machine.machine_zero import FILE_NAME
from compd.setpoint_states import State
from tests.support.paths import CONFIG
from tests.worlds.faults import begin
from tests.worlds.faults.gauges import jump
from tests.worlds.plan import Event, Plan
from tests.worlds.run import play
from tests.worlds.world import World, built

MOST = 3.0


def event(time_s: float, kind: str, **parameters: object) -> Event:
    family, name = kind.split(".")
    return Event(time_s, family, name, "", parameters)


def wrong(world: World) -> list[object]:
    return [told for told in world.told if told.valid and told.error_um > MOST * told.u_tip_um]


@pytest.mark.parametrize("kind", ["disk_full", "disk_read_only"])
@pytest.mark.parametrize("machine", ["tripod-cmm.yaml", pytest.param("hexapod.yaml", marks=pytest.mark.long)])
def test_gauges_that_were_accepted_for_a_zero_that_the_disk_refused_do_not_count_from_the_old_one(
    kind: str, machine: str
) -> None:
    with built(CONFIG / machine, 3) as world:
        jump(world, "scale_1.position", 1.0, 600.0)
        world.run(1.5)
        begin(world, "computer", kind, "", {"lasts_s": 3.0})
        world.take_zero()
        world.run(4.0)
        answer = world.clients.answers[-1].message
        assert answer is not None
        assert answer["code"] == "zero_refused"
        world.restart()
        world.forget()
        world.run(5.0)
        assert world.told[-1].state in (State.NO_ZERO, State.FAULT)
        assert not wrong(world)
        assert not world.died


def test_a_disk_that_hangs_while_zero_is_taken_holds_nothing_up() -> None:
    events = [event(0.2, "computer.disk_slow", by_s=6.0, lasts_s=3.0), event(0.5, "persons.zero")]
    report = play(
        Plan("tripod-cmm.yaml", 5, 9.0, 500.0, (*events, event(3.0, "computer.killed")._replace(target="loop")))
    )
    assert not report.findings, list(map(str, report.findings))
    assert report.valid_share > 0.8


@pytest.mark.parametrize("how", ["part", "nothing", "random"])
def test_a_machine_zero_that_a_power_cut_has_torn_is_asked_for(how: str) -> None:
    with built(CONFIG / "tripod-cmm.yaml", 4) as world:
        world.stop()
        world.system.boot()
        world.system.disk.tear(world.directory / "state" / FILE_NAME, how)
        world.forget()
        world.start()
        world.run(4.0)
        assert {told.state for told in world.told if told.state is not State.STOP} == {State.NO_ZERO}
        world.take_zero()
        assert world.until_ok()
        assert not world.died


def test_a_person_takes_machine_zero_where_a_power_cut_has_torn_it() -> None:
    events = [event(0.2, "persons.zero"), event(2.5, "computer.torn_file", how="part")]
    report = play(Plan("tripod-cmm.yaml", 6, 15.0, 500.0, tuple(events)))
    assert not report.findings, list(map(str, report.findings))
