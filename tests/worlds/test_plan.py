"""Plans: drawn from a seed and rates, the same each time, kept as JSON."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest
import yaml

from compd.configuration import load
from compd.machine_kinds import KINDS
from tests.worlds.faults.computer import PROCESSES
from tests.worlds.machines import MEASURED, machine_file, measured_errors
from tests.worlds.plan import MM_PER_S2, Plan, draw
from tests.worlds.rates import FILE, NONE, kinds, kinds_of

MACHINES = ("tripod-cmm.yaml", "hexapod.yaml", "linear-delta")


@pytest.mark.parametrize("machine", MACHINES)
def test_a_plan_is_the_same_from_its_seed_and_from_its_json(machine: str) -> None:
    plan = draw(7, 600.0, kinds_of("campaign"), machine)
    assert draw(7, 600.0, kinds_of("campaign"), machine) == plan
    assert draw(8, 600.0, kinds_of("campaign"), machine) != plan
    assert Plan.from_json(plan.to_json()) == plan


def test_a_plan_without_events_is_kept() -> None:
    plan = draw(7, 600.0, [], "tripod-cmm.yaml")
    assert not plan.events
    assert Plan.from_json(plan.to_json()) == plan


def test_events_come_as_often_as_their_rates_say() -> None:
    hours = 100
    plan = draw(1, 3600.0 * hours, kinds("campaign"), "tripod-cmm.yaml")
    counts = Counter(event.name for event in plan.events)
    for kind in kinds("campaign"):
        expected = kind.per_hour * hours
        assert abs(counts[f"{kind.family}.{kind.name}"] - expected) < 5 * expected**0.5, kind


def test_without_faults_there_is_work_alone() -> None:
    plan = draw(1, 3600.0, kinds(NONE), "tripod-cmm.yaml")
    names = {event.name for event in plan.events}
    assert names == {"machine.driven", "machine.jogged", "machine.rests", "machine.controlled"}


def test_parameters_lie_in_their_ranges() -> None:
    plan = draw(2, 36000.0, kinds("campaign"), "tripod-cmm.yaml")
    for event in plan.events:
        if event.name == "gauges.jump":
            most = 20.0 if event.target.startswith("scale") else 1.0
            assert 0.002 <= abs(event.parameters["by"]) <= most
        if event.name == "replies.lost":
            assert 1 <= event.parameters["count"] <= 20
        if event.name == "machine.driven":
            assert 0.5 <= max(map(abs, event.parameters["to_mm"])) <= 50.001
        if event.name == "computer.killed":
            assert event.target in PROCESSES


def test_a_kind_more_leaves_the_other_events_as_they_are() -> None:
    every = kinds("campaign")
    plan, fewer = draw(3, 600.0, every, "tripod-cmm.yaml"), draw(3, 600.0, every[1:], "tripod-cmm.yaml")
    left_out = f"{every[0].family}.{every[0].name}"
    assert tuple(event for event in plan.events if event.name != left_out) == fewer.events


def test_a_kind_that_nothing_plays_is_refused(tmp_path: Path) -> None:
    data = yaml.safe_load(FILE.read_text())
    data["lines"]["lightning"] = {"usual": 1, "campaign": 1, "target": "machine"}
    (tmp_path / "rates.yaml").write_text(yaml.safe_dump(data))
    with pytest.raises(ValueError, match=r"lines\.lightning"):
        kinds("campaign", tmp_path / "rates.yaml")


def test_the_acceleration_that_is_stated_is_that_of_the_fastest_drive() -> None:
    plan = draw(4, 600.0, kinds("campaign"), "tripod-cmm.yaml")
    drives = [event.parameters["mm_per_s2"] for event in plan.events if "mm_per_s2" in event.parameters]
    assert plan.mm_per_s2 == max(drives) > 10 * min(drives)
    assert draw(4, 600.0, [], "tripod-cmm.yaml").mm_per_s2 == MM_PER_S2


@pytest.mark.parametrize("kind", KINDS)
def test_a_measured_machine_has_a_line_for_each_scale_and_one_for_its_joints(kind: str, tmp_path: Path) -> None:
    configuration = load(machine_file(f"{kind}{MEASURED}", tmp_path))
    scales = [wire.gauge for wire in configuration.wiring.scale]
    assert [*configuration.lines] == [*scales, "joints"]
    assert len(configuration.wiring.joint) == len(scales)
    assert not measured_errors(configuration).ball_runout_um
