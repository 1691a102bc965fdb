"""A machine under a controller: its setpoints hold where they send the scales, and end when its targets are old."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import pytest

from compd.live.loop import Commands
from compd.setpoint_states import Mode
from tests.worlds.plan import Event, Plan
from tests.worlds.run import Report, play
from tests.worlds.sight import Sight


def event(time_s: float, kind: str, **parameters: object) -> Event:
    family, name = kind.split(".")
    return Event(time_s, family, name, "", parameters)


def played(events: Sequence[Event], duration_s: float, machine: str) -> tuple[Report, list[Sight]]:
    sights: list[Sight] = []
    return play(Plan(machine, 12, duration_s, 500.0, tuple(events)), sights.append), sights


def controlled(links: int, lasts_s: float) -> Event:
    to_mm = [4.0 + link for link in range(links)]
    return event(0.2, "machine.controlled", to_mm=to_mm, mm_per_s=2.0, lasts_s=lasts_s)


MACHINES = [("tripod-cmm.yaml", 3), pytest.param("hexapod.yaml", 6, marks=pytest.mark.long)]


@pytest.mark.parametrize(("machine", "links"), MACHINES)
def test_a_controller_has_the_machine_until_it_is_driven_otherwise(machine: str, links: int) -> None:
    jogged = event(2.0, "machine.jogged", by_mm=[0.5] * links, mm_per_s=5.0)
    report, sights = played([controlled(links, 20.0), jogged], 3.0, machine)
    assert not report.findings, list(map(str, report.findings))
    modes = [sight.setpoint.mode for sight in sights if sight.told.valid]
    assert modes.count(Mode.MACHINE_TOOL) > 0.3 * len(modes)
    assert set(modes[-50:]) == {Mode.CMM}
    assert any(sight.told.moving for sight in sights if sight.setpoint.mode is Mode.MACHINE_TOOL)


@pytest.mark.parametrize("kind", ["old_targets", "silence"])
def test_setpoints_end_with_targets_that_are_too_old(kind: str) -> None:
    report, sights = played([event(0.2, f"controller.{kind}", lasts_s=5.5)], 7.0, "tripod-cmm.yaml")
    assert not report.findings, list(map(str, report.findings))
    assert any("too old" in sight.told.reason for sight in sights)
    assert sights[-1].told.valid


def test_a_loop_that_follows_an_old_target_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    read: property = vars(Commands)["target"]

    def never_too_old(commands: Commands) -> object:
        target = read.__get__(commands)
        return None if target is None else replace(target, valid_until_s=math.inf)

    monkeypatch.setattr(Commands, "target", read.getter(never_too_old))
    report, _ = played([event(0.2, "controller.old_targets", lasts_s=6.0)], 6.0, "tripod-cmm.yaml")
    assert "fresh_target" in {finding.what for finding in report.findings}


def test_exchanged_links_are_the_controllers_fault() -> None:
    report, sights = played(
        [event(0.2, "controller.exchanged_links", links=(1, 2), lasts_s=1.0)], 3.0, "tripod-cmm.yaml"
    )
    assert not report.findings, list(map(str, report.findings))
    assert any(sight.setpoint.mode is Mode.MACHINE_TOOL for sight in sights)
