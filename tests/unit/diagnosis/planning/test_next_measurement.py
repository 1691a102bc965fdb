"""The next measurement: rows that tell rivals apart, within limits, as CSV; and the two commands."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

import compd
from compd.cli.measurements.diagnose import diagnose as diagnose_command
from compd.cli.measurements.plan import plan as plan_command
from compd.comparison import AlignedRecording, search_constants
from compd.errors import CompdError, RecordingError
from compd.model.effects import FittedEffect
from compd.planning import (
    MeasurementPlan,
    PlanningCriteria,
    ProgrammeLimits,
    measurement_of_constant,
    measurement_to_test,
    next_measurement,
    plan_measurement,
    recorded_limits,
)
from compd.planning.measurement_plan import NextMeasurement
from tests.support.hidden_effects import LIBRARY, NOISE_UM, record_with_effects

SIGMA_UM = np.full(3, NOISE_UM)


def app() -> typer.Typer:
    commands = typer.Typer()
    commands.command("diagnose")(diagnose_command)
    commands.command("plan")(plan_command)
    return commands


def fit_rivals(aligned: AlignedRecording, *names: str) -> tuple[FittedEffect, FittedEffect]:
    first, second = (search_constants(aligned, (), LIBRARY[name], SIGMA_UM).fitted[-1] for name in names)
    return first, second


def plan_rivals(
    aligned: AlignedRecording, names: tuple[str, str], rows: int = 30, limits: ProgrammeLimits | None = None
) -> MeasurementPlan:
    return plan_measurement(
        aligned, (), fit_rivals(aligned, *names), SIGMA_UM, limits or recorded_limits(aligned), rows
    )


def test_a_plan_separates_spring_and_contact_by_loads(tmp_path: Path) -> None:
    aligned = record_with_effects(tmp_path / "run.csv", 1, {"link_elasticity": (1 / 60,)})
    limits = recorded_limits(aligned)._replace(force_N=120.0)
    plan = plan_rivals(aligned, ("link_elasticity", "joint_contact"), 30, limits)
    assert plan.separation > 1.5 * plan.before
    assert len(plan.rows) <= 30
    loads = np.array([[row[f"force_{axis}_N"] for axis in "xyz"] for row in plan.rows])
    assert np.abs(loads).max() == pytest.approx(120.0)
    assert len(np.unique(np.abs(loads[loads != 0]).round(1))) >= 2  # a line and a curve differ in the middle


def test_a_plan_separates_backlash_and_friction_by_growing_reversals(tmp_path: Path) -> None:
    aligned = record_with_effects(tmp_path / "run.csv", 1, {"friction_hysteresis": (0.8,)})
    plan = plan_rivals(aligned, ("friction_hysteresis", "backlash"))
    assert plan.separation > plan.before
    assert "reversals in growing steps" in {row["purpose"] for row in plan.rows}


def test_more_rows_separate_more(tmp_path: Path) -> None:
    aligned = record_with_effects(tmp_path / "run.csv", 2, {"tool_offset": (0.5, -0.4, 0.3)})
    few, many = (plan_rivals(aligned, ("tool_offset", "link_zero"), rows) for rows in (6, 30))
    assert few.before < few.separation < many.separation


def test_a_plan_stays_within_its_limits(tmp_path: Path) -> None:
    aligned = record_with_effects(tmp_path / "run.csv", 1, {"link_elasticity": (1 / 60,)})
    low, high = np.array([-20.0, -15.0, 170.0]), np.array([25.0, 20.0, 200.0])
    limits = ProgrammeLimits(low, high, 30.0, (18.0, 23.0), 0.0)
    plan = plan_rivals(aligned, ("link_expansion", "link_elasticity"), 40, limits)
    for row in plan.rows:
        tip = np.array([row[f"tip_{axis}_mm"] for axis in "xyz"])
        assert (low - 1e-3 <= tip).all()
        assert (tip <= high + 1e-3).all()
        assert max(abs(row[f"force_{axis}_N"]) for axis in "xyz") <= 30.0
        assert all(18.0 <= value <= 23.0 for name, value in row.items() if name.startswith("temperature_"))
        assert row["speed_mm_per_s"] == 0.0


def test_a_place_out_of_reach_is_refused(tmp_path: Path) -> None:
    aligned = record_with_effects(tmp_path / "run.csv", 1, {})
    far = recorded_limits(aligned)._replace(tip_high_M_mm=np.array([5000.0, 5000.0, 5000.0]))
    with pytest.raises(RecordingError, match="out of reach"):
        plan_rivals(aligned, ("tool_offset", "link_zero"), 10, far)


def test_an_instruments_frame_is_fitted_along(tmp_path: Path) -> None:
    aligned = record_with_effects(tmp_path / "run.csv", 1, {"tool_offset": (0.5, -0.4, 0.3)})
    sidecar = tmp_path / "run.yaml"
    sidecar.write_text(sidecar.read_text().replace("frame: machine", "frame: instrument"))
    framed = compd.open_recording(tmp_path / "run.csv")
    strengths = {"tool_offset": (0.5, -0.4, 0.3), "link_elasticity": (1.0,)}
    offset, spring = (FittedEffect(LIBRARY[name], np.array(theta)) for name, theta in strengths.items())
    plans = [
        plan_measurement(recording, (), (offset, spring), SIGMA_UM, recorded_limits(aligned), 12)
        for recording in (aligned, framed)
    ]
    # a frame that lies elsewhere does nearly what the offset does
    assert plans[1].before < 0.2 * plans[0].before
    assert plans[1].separation < 0.2 * plans[0].separation


def test_rivals_get_rows_and_what_they_will_do(tmp_path: Path) -> None:
    aligned = record_with_effects(tmp_path / "run.csv", 1, {"link_elasticity": (1 / 60,)}, visits=60)
    found, _ = fit_rivals(aligned, "link_elasticity", "joint_contact")
    answer = next_measurement(
        aligned, (), found, LIBRARY["joint_contact"], SIGMA_UM, criteria=PlanningCriteria(rows=20)
    )
    assert answer.effects == ("link_elasticity", "joint_contact")
    assert answer.plan is not None
    assert answer.plan.separation >= max(PlanningCriteria.min_separation, answer.plan.before + 1)
    assert len(answer.as_json()) == len(answer.plan.rows) <= 20
    assert answer.promise.startswith("The rows under 'next' can")


def test_rivals_that_no_rows_within_the_limits_part_get_words(tmp_path: Path) -> None:
    aligned = record_with_effects(tmp_path / "run.csv", 1, {"link_zero": (0.5, -0.4, 0.3)})
    found, _ = fit_rivals(aligned, "link_zero", "tool_offset")
    answer = next_measurement(aligned, (), found, LIBRARY["reference_registration"], SIGMA_UM)
    assert answer.plan is None
    (words,) = answer.as_json()
    assert words["measure"].startswith(LIBRARY["link_zero"].separated_by)
    assert words["why"] in answer.promise
    assert "The rows under" not in answer.promise


def without_columns(aligned: AlignedRecording, path: Path, *words: str) -> AlignedRecording:
    """The recording without the columns whose names begin with one of the words."""
    header, *rows = (line.split(",") for line in aligned.recording.path.read_text().splitlines())
    kept = [k for k, name in enumerate(header) if not name.startswith(words)]
    path.write_text("\n".join(",".join(cells[k] for k in kept) for cells in (header, *rows)) + "\n")
    path.with_suffix(".yaml").write_text(aligned.recording.path.with_suffix(".yaml").read_text())
    return compd.open_recording(path)


def test_an_untestable_effect_is_told_which_gauge_it_needs(tmp_path: Path) -> None:
    whole = record_with_effects(tmp_path / "run.csv", 1, {}, visits=60)
    aligned = without_columns(whole, tmp_path / "less.csv", "temperature_tool")
    answer = measurement_to_test(aligned, (), LIBRARY["tool_expansion"], SIGMA_UM)
    assert answer.plan is None
    assert "temperature_tool_degC" in answer.measure
    assert "thermometer" in answer.measure
    assert "no gauge measures" in answer.why


def test_a_rival_whose_thermometer_is_missing_is_parted_by_that_thermometer(tmp_path: Path) -> None:
    whole = record_with_effects(tmp_path / "run.csv", 1, {"link_expansion": (1.0,)}, visits=60)
    aligned = without_columns(whole, tmp_path / "less.csv", "temperature_tool")
    found, _ = fit_rivals(aligned, "link_expansion", "link_zero")
    answer = next_measurement(aligned, (), found, LIBRARY["tool_expansion"], SIGMA_UM)
    assert answer.effects == ("link_expansion", "tool_expansion")
    assert answer.plan is None
    assert "temperature_tool_degC" in answer.measure
    assert "tool_expansion needs temperature_tool_degC" in answer.promise


def test_an_effect_that_is_not_excited_gets_rows_that_excite_it(tmp_path: Path) -> None:
    aligned = record_with_effects(tmp_path / "run.csv", 1, {}, visits=60)
    answer = measurement_to_test(aligned, (), LIBRARY["backlash"], SIGMA_UM)
    assert answer.plan is not None
    assert answer.plan.rivals == ("backlash",)
    assert {row["approach_1"] for row in answer.plan.rows} == {-1, 1}
    assert "seen" in answer.promise
    still = measurement_to_test(aligned, (), LIBRARY["gauge_latency"], SIGMA_UM)
    assert still.plan is None
    assert still.measure == LIBRARY["gauge_latency"].separated_by


def test_the_causes_of_a_constant_are_parted_where_they_are_none(tmp_path: Path) -> None:
    aligned = record_with_effects(tmp_path / "run.csv", 1, {}, visits=60)
    causes = [LIBRARY[name] for name in ("tool_offset", "link_zero")]
    answer = measurement_of_constant(aligned, (), causes, np.array([40.0, -30.0, 20.0]), SIGMA_UM)
    assert isinstance(answer, NextMeasurement)
    assert answer.plan is not None
    assert set(answer.plan.rivals) == {"a constant", "tool_offset", "link_zero"}
    small = measurement_of_constant(aligned, (), causes, np.array([0.01, 0.0, 0.0]), SIGMA_UM)
    assert small.plan is None
    assert small.measure


def test_the_plan_command_writes_csv(tmp_path: Path) -> None:
    record_with_effects(tmp_path / "run.csv", 1, {"link_elasticity": (1 / 60,)})
    out = tmp_path / "next.csv"
    arguments = ["plan", str(tmp_path / "run.csv"), "--rivals", "link_elasticity,joint_contact", "--rows", "24"]
    result = CliRunner().invoke(app(), [*arguments, "--force", "100", "--out", str(out)])
    assert result.exit_code == 0, result.output
    with out.open() as stream:
        rows = list(csv.DictReader(stream))
    assert 12 <= len(rows) <= 24
    assert [row["row"] for row in rows] == [str(k + 1) for k in range(len(rows))]
    assert {"tip_x_mm", "force_z_N", "approach_3", "speed_mm_per_s"} <= set(rows[0])
    assert "Set tip_x_mm" in result.output
    shown = CliRunner().invoke(app(), arguments)
    assert shown.stdout.startswith("row,purpose,time_s")


def test_of_three_rivals_the_rows_part_those_that_can_be_and_the_others_are_named(tmp_path: Path) -> None:
    aligned = record_with_effects(tmp_path / "run.csv", 1, {"link_elasticity": (1 / 60,)}, visits=60)
    spring, contact = fit_rivals(aligned, "link_elasticity", "joint_contact")
    twin = replace(spring, effect=replace(spring.effect, id="twin"))  # nothing parts the two
    limits = recorded_limits(aligned)._replace(force_N=100.0)
    plan = plan_measurement(aligned, (), (spring, contact, twin), SIGMA_UM, limits, 20)
    assert plan.rivals == ("link_elasticity", "joint_contact", "twin")
    assert plan.alike == (("link_elasticity", "twin"),)
    assert plan.separation >= PlanningCriteria.min_separation
    words = "No rows within the limits tell link_elasticity from twin. Within the limits they correct alike"
    assert words in plan.summary


def test_three_rivals_that_rows_tell_apart_are_planned_for_together(tmp_path: Path) -> None:
    record_with_effects(tmp_path / "run.csv", 1, {"link_elasticity": (1 / 60,)}, visits=60)
    names = ["link_elasticity", "joint_contact", "link_zero"]
    plan = compd.plan_measurement(tmp_path / "run.csv", names, rows=20, force_N=100.0)
    assert plan.alike == ()
    assert plan.separation >= PlanningCriteria.min_separation
    assert plan.summary.startswith("The errors from link_elasticity, joint_contact and link_zero differ by at least ")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--rivals", "link_zero"], "needs two effects or more"),
        (["--rivals", "link_zero,link_zero"], "needs two effects or more"),
        (["--rivals", "link_zero,no_such"], "no such effect"),
        (["--rivals", "link_zero,tool_offset", "--temperature", "25,20"], "is not understood"),
        (["--rivals", "link_zero,tool_offset", "--workspace", "1,2,3"], "is not understood"),
        (["--rivals", "link_zero,tool_offset", "--limit", "force_x_N=0,3"], "is a limit of an external machine"),
        (["--rivals", "link_zero,tool_offset", "--limit", "force_x_N"], "--limit force_x_N: is not understood"),
        (["--rivals", "link_zero,tool_offset", "--limit", "a=0,3", "--limit", "a=0,4"], "is given twice"),
    ],
)
def test_mistakes_are_refused(tmp_path: Path, options: list[str], message: str) -> None:
    record_with_effects(tmp_path / "run.csv", 1, {})
    result = CliRunner().invoke(app(), ["plan", str(tmp_path / "run.csv"), *options])
    assert isinstance(result.exception, CompdError)
    assert message in str(result.exception)


def test_the_diagnose_command_prints_verdict_json_and_page(tmp_path: Path) -> None:
    for name, seed in (("run.csv", 1), ("other.csv", 2)):
        record_with_effects(tmp_path / name, seed, {"link_elasticity": (1 / 30,)})
    page = tmp_path / "page.html"
    paths = [str(tmp_path / "run.csv"), str(tmp_path / "other.csv")]
    result = CliRunner().invoke(app(), ["diagnose", *paths, "--html", str(page)])
    assert result.exit_code == 0, result.output
    assert result.stdout.startswith("identified: What is missing is link_elasticity")
    assert "Sealed until now" in result.stdout
    text = page.read_text()
    assert "What is missing is link_elasticity" in text
    assert "http" not in text.split("</script>")[-1]
    data = json.loads(CliRunner().invoke(app(), ["diagnose", *paths, "--json"]).stdout)
    assert data["verdict"] == "identified"
    assert data["sealed"][0]["final_floor_ratio"] < 1.2
