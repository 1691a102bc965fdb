"""What persons adopt is what runs, whatever ends meanwhile; and nothing of it is a jump."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import pytest

from compd.live.loop import AdoptedModels
from compd.live.machine import MachineZero, Models
from compd.setpoint_states import State
from tests.worlds.plan import Event, Plan
from tests.worlds.run import Report, play
from tests.worlds.sight import Sight


def event(time_s: float, kind: str, target: str = "", **parameters: object) -> Event:
    family, name = kind.split(".")
    return Event(time_s, family, name, target, parameters)


def adopts(time_s: float, model: str, um: float, shadow: bool = False) -> Event:
    return event(time_s, "persons.adopt", model=model, um=um, shadow=shadow)


def played(events: Sequence[Event], duration_s: float, machine: str = "tripod-cmm.yaml") -> tuple[Report, list[Sight]]:
    sights: list[Sight] = []
    return play(Plan(machine, 11, duration_s, 500.0, tuple(events)), sights.append), sights


def models(sights: Sequence[Sight]) -> list[str]:
    """Hashes of the applied models, one after the other."""
    used = [sight.setpoint.model for sight in sights]
    return [model for before, model in zip([None, *used], used, strict=False) if model != before]


def largest_mm(sights: Sequence[Sight]) -> float:
    found = [abs(sight.setpoint.values.correction_mm).max() for sight in sights if sight.setpoint.values is not None]
    return float(max(found))


@pytest.mark.parametrize("machine", ["tripod-cmm.yaml", pytest.param("hexapod.yaml", marks=pytest.mark.long)])
def test_an_adopted_model_slews_in_and_survives_its_loop(machine: str) -> None:
    report, sights = played(
        [
            event(0.1, "machine.driven", to_mm=[20.0] * (3 if "tripod" in machine else 6), mm_per_s=50.0),
            adopts(0.5, "link_zero", 120.0),
            event(1.5, "computer.killed", "loop"),
            adopts(2.5, "scale_gain", 80.0),
            adopts(3.5, "", 1.0),
        ],
        4.5,
        machine,
    )
    assert not report.findings, list(map(str, report.findings))
    assert largest_mm(sights) > 0.05
    first, constant, gain, none = models(sights)
    assert first == none == ""
    assert "" not in (constant, gain)
    assert constant != gain


def test_a_shadow_changes_nothing_until_it_is_applied() -> None:
    report, sights = played([adopts(0.5, "link_zero", 100.0, shadow=True), event(1.5, "persons.apply_shadow")], 2.5)
    assert not report.findings, list(map(str, report.findings))
    beside = [sight for sight in sights if sight.setpoint.shadow is not None]
    assert beside
    assert largest_mm(beside) < 0.01
    _, applied = models(sights)
    assert {sight.setpoint.shadow.model for sight in beside if sight.setpoint.shadow} == {applied}
    assert largest_mm(sights) > 0.05


def test_a_model_that_was_not_kept_is_gone_with_the_service_that_was_killed() -> None:
    report, sights = played([adopts(0.5, "link_zero", 100.0), event(1.5, "computer.killed", "service")], 5.0)
    assert not report.findings, list(map(str, report.findings))
    first, adopted, after = models(sights)
    assert (first, after) == ("", "")
    assert adopted


def test_a_loop_that_forgets_its_model_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(AdoptedModels, "load", lambda adopted, loader: Models(loader.load(None), None))
    report, _ = played([adopts(0.2, "link_zero", 100.0), event(1.5, "computer.killed", "loop")], 3.0)
    assert [finding.what for finding in report.findings] == ["adopted_model"]


def test_machine_zero_is_the_one_that_was_taken_last() -> None:
    report, _ = played([event(0.2, "persons.zero"), event(2.5, "computer.restart")], 7.0)
    assert not report.findings, list(map(str, report.findings))


def test_a_machine_zero_that_is_not_written_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(MachineZero, "save", lambda zero, directory, system: directory)
    report, _ = played([event(0.2, "persons.zero"), event(2.5, "computer.restart")], 7.0)
    assert [finding.what for finding in report.findings] == ["nothing_lost"]


def test_a_reload_slews_as_fast_as_its_new_limit_and_one_that_is_refused_changes_nothing() -> None:
    slower = event(0.2, "persons.reload", key="limits.slew_mm_per_s", factor=0.1)
    report, sights = played(
        [slower, event(2.0, "persons.reload_refused", lasts_s=0.5), adopts(3.5, "link_zero", 100.0)], 5.0
    )
    assert not report.findings, list(map(str, report.findings))
    times_s = [sight.told.time_s for sight in sights if sight.told.time_s > sights[0].told.time_s + 2.0]
    assert max(after - before for before, after in pairwise(times_s)) < 0.1
    first, last = (sights[i].configuration.limits.slew_mm_per_s for i in (0, -1))
    assert last == pytest.approx(0.1 * first)
    assert any(sight.told.state is State.SLEWING for sight in sights)
