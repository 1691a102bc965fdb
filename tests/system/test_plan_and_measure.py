"""What `compd plan` plans, measured: without wires until one name is left; on wires until the machine stands still."""

from __future__ import annotations

import csv
import json
import shutil
import socket
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

from compd.cli.app import app
from compd.cli.simulated.sim.run import _planned
from compd.configuration import load
from compd.errors import CompdError
from compd.recording import read_recording
from compd.simulation import Mechanism, Simulation, World, read_plan
from compd.simulation.truth.plan_motion import SETTLED_S
from tests.support.patience import PATIENCE_S
from tests.support.planned_measurements import plan_file, straight_down, thin
from tests.support.simulated import TRIPOD, ask, run_directory
from tests.unit.simulation.test_server import TurnedClock

PAIR = ("link_elasticity", "joint_contact")


def compd(*arguments: str | Path) -> str:
    """What the command prints; its own error where it fails."""
    result = CliRunner().invoke(app, list(map(str, arguments)))
    if result.exception is not None:
        raise result.exception
    return result.output


def diagnosed(recording: Path) -> dict[str, Any]:
    return dict(json.loads(compd("diagnose", recording, "--json")))


def names(verdict: dict[str, Any]) -> set[str]:
    return {name for step in verdict["steps"] for name in (step["effect"], *step["rivals"])}


@pytest.mark.long
@pytest.mark.parametrize("hidden", ["link_elasticity=100", "joint_contact=0.05"])
def test_a_planned_measurement_leaves_one_name(tmp_path: Path, hidden: str) -> None:
    """Loads of one size and direction leave two names; the plan's loads, on the same machine, leave the right one."""
    first, poor, plan, second, both = (tmp_path / f"{n}.csv" for n in ("first", "poor", "plan", "second", "both"))
    machine = ("sim", "campaign", TRIPOD, "--seed", "5", "--effect", hidden)
    compd(*machine, "--out", first)
    thin(first, poor, straight_down)
    before = diagnosed(poor)
    assert (before["verdict"], names(before)) == ("ambiguous", set(PAIR))
    said = compd("plan", poor, "--rivals", ",".join(PAIR), "--rows", "40", "--force", "100", "--out", plan)
    assert "with these 40 rows" in said
    assert "the plan's 40 rows, 80 with repeats" in compd(*machine, "--plan", plan, "--out", second)
    assert "rows (" in compd("recording", "merge", poor, second, "--out", both)
    after = diagnosed(both)
    assert (after["verdict"], names(after)) == ("identified", {hidden.partition("=")[0]})


# --- recordings put together ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of three planned rows."""
    path = tmp_path_factory.mktemp("short") / "short.csv"
    rows = [{"tip_x_mm": 10.0}, {"tip_y_mm": 10.0}, {"speed_mm_per_s": 5.0, "approach_1": 1}]
    compd("sim", "campaign", TRIPOD, "--plan", plan_file(path.with_suffix(".plan.csv"), rows), "--out", path)
    return path


def copied(short: Path, path: Path, began: datetime | None = None, **sidecar: Any) -> Path:
    """The same recording under another name, with another sidecar."""
    for suffix in (".csv", ".yaml"):
        shutil.copy(short.with_suffix(suffix), path.with_suffix(suffix))
    says = yaml.safe_load(path.with_suffix(".yaml").read_text(encoding="utf-8")) | sidecar
    if began is not None:
        says["provenance"] = {"started_at": began.isoformat(), "zero_taken_at": "this morning"}
    path.with_suffix(".yaml").write_text(yaml.safe_dump(says), encoding="utf-8")
    return path


@pytest.mark.long
def test_merged_recordings_keep_their_rows_apart(tmp_path: Path, short: Path) -> None:
    monday = datetime(2026, 3, 2, 8, 0, tzinfo=UTC)
    first = copied(short, tmp_path / "first.csv", monday, excluded_rows=[{"row": 3, "reason": "the beam was cut"}])
    second = copied(short, tmp_path / "second.csv", monday + timedelta(hours=5))
    with second.open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    with second.open("w", newline="", encoding="utf-8") as stream:
        without = csv.DictWriter(stream, [n for n in rows[0] if n != "humidity_pct"], extrasaction="ignore")
        without.writeheader()
        without.writerows(rows)
    said = compd("recording", "merge", first, second, "--out", tmp_path / "both")
    assert "not recorded" not in said
    one, both = (read_recording(tmp_path / name, load(TRIPOD)) for name in ("first.csv", "both.csv"))
    assert both.rows == 2 * one.rows
    assert both.time_s[one.rows] == pytest.approx(5 * 3600.0)
    assert both.session is not None
    assert both.visit is not None
    assert np.unique(both.session).tolist() == [1, 2]
    assert len(np.unique(both.visit)) == 2 * len(np.unique(one.visit))
    assert both.excluded.sum() == 1
    assert both.sidecar.excluded == {3: "the beam was cut"}
    assert np.isnan(both.columns["humidity_pct"][one.rows :]).all()
    np.testing.assert_array_equal(both.columns["scale_1_mm"][: one.rows], one.columns["scale_1_mm"])


@pytest.mark.long
def test_an_unknown_time_between_recordings_is_said(tmp_path: Path, short: Path) -> None:
    first, second = copied(short, tmp_path / "first.csv"), copied(short, tmp_path / "second.csv")
    assert "1 h is put between them" in compd("recording", "merge", first, second, "--out", tmp_path / "both.csv")


def test_recordings_that_do_not_fit_together(tmp_path: Path, short: Path) -> None:
    first = copied(short, tmp_path / "first.csv")
    reference = {"quantity": "tool_position", "frame": "machine", "sigma_um": 0.3}
    worse = copied(short, tmp_path / "worse.csv", reference=reference, provenance={"zero_taken_at": "another morning"})
    apart = copied(short, tmp_path / "apart.csv", reference=reference | {"frame": "instrument"})
    with pytest.raises(CompdError) as caught:
        compd("recording", "merge", first, worse, apart, "--out", tmp_path / "both.csv")
    said = str(caught.value)
    for what in (
        "worse.yaml: has another reference",
        "worse.yaml: was recorded from another machine zero",
        "apart.yaml: the instrument's own frame",
    ):
        assert what in said
    assert not (tmp_path / "both.csv").exists()
    with pytest.raises(CompdError, match="two recordings or more"):
        compd("recording", "merge", first, "--out", tmp_path / "both.csv")


# --- on wires -------------------------------------------------------------------------------------------------


def test_the_machine_goes_through_its_plan_on_wires(tmp_path: Path) -> None:
    """It walks, measures every row, tells where it is, stands still; and another command lets go of what is held."""
    up = {f"approach_{i}": 1 for i in (1, 2, 3)}
    warm = {"temperature_platform_degC": 26.0}
    path = plan_file(
        tmp_path / "next.csv",
        [
            {"tip_x_mm": 30.0, **up},
            {"tip_x_mm": 30.0, "time_s": 600.0, "purpose": "warm", **warm, **up},
            {"speed_mm_per_s": 10.0, **warm, **up},
        ],
        [*warm],
    )
    configuration = load(TRIPOD)
    rows = read_plan(path, Mechanism(configuration.geometry), [wire.name for wire in configuration.wiring.quantities])
    world = World(configuration.geometry, configuration.wiring, 1, 100.0, zero_hold_s=5.0, rows=rows)
    clock = TurnedClock()
    with run_directory() as directory, socket.socket(socket.AF_UNIX) as control:
        simulation = Simulation(configuration, world, directory, clock)
        simulation.start()
        try:
            control.settimeout(PATIENCE_S)
            control.connect(str(directory / "control.sock"))
            assert "plan" not in ask(control, {"class": "TRUTH"})
            clock.turn(5.1)
            truth = ask(control, {"class": "TRUTH"})
            assert (truth["mode"], truth["plan"]["doing"], truth["plan"]["rows"]) == ("plan", "walk", 3)
            seen = []
            while not truth["plan"]["done"]:
                clock.turn(0.1)
                truth = ask(control, {"class": "TRUTH"})
                if truth["plan"]["doing"] == "look" and not truth["moving"]:
                    seen.append((truth["plan"]["row"], truth["plan"]["purpose"], world.sense(next(iter(warm)))))
            assert [row for row, _, _ in dict.fromkeys((row, purpose, 0) for row, purpose, _ in seen)] == [1, 2, 3]
            assert all(degC == pytest.approx(26.0, abs=0.1) for row, _, degC in seen if row > 1)
            assert all(sum(row == number for row, _, _ in seen) >= 10 for number in (1, 2, 3))
            assert truth["tip_mm"] != pytest.approx([30.0, 0.0, 190.0], abs=5.0)  # it has passed the last row
            assert ask(control, {"class": "TRUTH"})["scale_mm"] == truth["scale_mm"]
            ask(control, {"class": "DRIVE", "scale_mm": [0.0, 0.0, 0.0]})
            clock.turn(SETTLED_S)  # 100 times faster in the weather
            assert world.sense("temperature_platform_degC") < 24.0
            assert "plan" not in ask(control, {"class": "TRUTH"})
            assert ask(control, {"class": "PLAN"})["plan"]["row"] == 1
        finally:
            simulation.stop()


def test_without_a_plan_there_is_nothing_to_go_through() -> None:
    configuration = load(TRIPOD)
    with pytest.raises(CompdError, match="nothing is planned"):
        World(configuration.geometry, configuration.wiring, 1).start_plan()


def test_a_wrong_plan_is_said_before_the_machine_starts(tmp_path: Path) -> None:
    path = plan_file(tmp_path / "next.csv", [{"force_x_N": 5.0, "tip_x_mm": "far"}], ["force_x_N"])
    with pytest.raises(CompdError) as caught:
        compd("sim", "run", TRIPOD, "--directory", tmp_path / "machine", "--plan", path)
    assert [one.what for one in caught.value.problems] == [
        "no gauge of this machine measures it: no recording will tell",
        "text where a number belongs",
    ]
    assert not (tmp_path / "machine").exists()


def test_the_status_line_tells_the_row() -> None:
    plan = {"row": 3, "rows": 40, "purpose": "load along x in steps", "doing": "settle", "done": False}
    assert _planned(plan) == "row 3 of 40, load along x in steps: parts settle"
    assert _planned({**plan, "doing": "done", "done": True}) == "the plan is done, standing still"
