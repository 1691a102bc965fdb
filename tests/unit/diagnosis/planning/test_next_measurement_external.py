"""The next measurement on machines of an external model: settings of their columns, or words where none would do."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

import compd
from compd.arrays import FloatArray
from compd.cli.measurements.plan import plan as plan_command
from compd.comparison import AlignedRecording, fit, initial_effect
from compd.errors import CompdError
from compd.model.effects import Effect, FittedEffect
from compd.model.formula import formula_effect
from compd.model.library import load_library
from compd.planning import (
    PlanningCriteria,
    measurement_of_constant,
    measurement_to_test,
    next_measurement,
    plan_measurement,
)
from tests.support.external_recordings import SIGMA_UM, along, record_external

ROWS = 60
RAD = "(0.0174532925 * elevation_deg)"
TUBE = along("y", "tube", f"k * cos{RAD}")
ANGLE = along("y", "angle", f"k * cos{RAD} / sin{RAD}")
ZERO = along("y", "zero", "k")
PLAY = along("x", "play", "k * moved_1")
WINDUP = along("x", "windup", "k * moved_1 * tip_x_mm / 100")
BED = along("z", "bed", "k * (temperature_bed_degC - 20) / 10")
BED_LATER = along("z", "bed_later", "k * lag(temperature_bed_degC - 20, 600) / 10")


def telescope(path: Path, elevation_deg: tuple[float, float] = (40.0, 60.0), seed: int = 1) -> AlignedRecording:
    """A telescope whose tube bends by 20 um, seen in some part of the sky."""
    rng = np.random.default_rng(seed)
    elevation = rng.uniform(*elevation_deg, ROWS)
    columns = {"azimuth_deg": rng.uniform(0, 360, ROWS), "elevation_deg": elevation}
    return record_external(path, columns, {"x": np.zeros(ROWS), "y": 20 * np.cos(np.radians(elevation)) + 5})


def stage(path: Path) -> AlignedRecording:
    """A stage with 2 um of play, at four stops from both sides, all of them in the first tenth of its travel."""
    stops = np.repeat([10.0, 12.0, 14.0, 16.0], ROWS // 4)
    moved = np.where(np.arange(ROWS) % 2 == 0, 1.0, -1.0)
    columns = {"moved_1": moved, "position_mm": stops}
    return record_external(path, columns, {"x": moved}, model_mm={"x": stops})


def printer(path: Path) -> AlignedRecording:
    """A printer whose bed bends it, slowly warmed."""
    bed = np.linspace(20.0, 60.0, ROWS)
    columns = {"time_s": 600.0 * np.arange(ROWS), "temperature_bed_degC": bed}
    return record_external(path, columns, {"z": bed - 20})


def fitted(aligned: AlignedRecording, effect: Effect) -> FittedEffect:
    return fit(aligned, [initial_effect(effect, {}, 0)]).fitted[0]


def sigma_um(aligned: AlignedRecording) -> FloatArray:
    return np.full(len(aligned.labels), SIGMA_UM)


def test_a_plan_sets_what_the_formulas_need_within_the_recorded_limits(tmp_path: Path) -> None:
    aligned = telescope(tmp_path / "sky.csv")
    plan = compd.plan_measurement(aligned, ("tube", "angle"), effects=[TUBE, ANGLE], rows=20)
    assert list(plan.rows[0]) == ["row", "purpose", "time_s", "elevation_deg"]
    assert len(plan.rows) == 20
    recorded = aligned.recording.quantities["elevation_deg"]
    planned = [row["elevation_deg"] for row in plan.rows]
    assert recorded.min() <= min(planned) < 41.0
    assert 59.0 < max(planned) <= recorded.max()
    assert plan.separation > plan.before
    assert plan.instructions.startswith("Set elevation_deg from 40")


def test_wider_limits_separate_more(tmp_path: Path) -> None:
    aligned = telescope(tmp_path / "sky.csv")
    names = ("tube", "angle")
    narrow = compd.plan_measurement(aligned, names, effects=[TUBE, ANGLE], rows=20)
    limits = {"elevation_deg": (20.0, 85.0)}
    wide = compd.plan_measurement(aligned, names, effects=[TUBE, ANGLE], rows=20, limits=limits)
    planned = [row["elevation_deg"] for row in wide.rows]
    assert (min(planned), max(planned)) == (20.0, 85.0)
    assert wide.before == narrow.before
    assert wide.separation > 3 * narrow.separation
    assert wide.tells_apart
    assert not narrow.tells_apart


def test_the_separation_is_what_the_wrong_effect_leaves_of_noiseless_rows(tmp_path: Path) -> None:
    aligned = telescope(tmp_path / "sky.csv")
    plan = compd.plan_measurement(
        aligned, ("tube", "angle"), effects=[TUBE, ANGLE], rows=20, limits={"elevation_deg": (20.0, 85.0)}
    )
    planned = [row["elevation_deg"] for row in plan.rows]
    elevation = np.concatenate([aligned.recording.quantities["elevation_deg"], planned])
    bend_um, cotangent_um = np.cos(np.radians(elevation)), 1 / np.tan(np.radians(elevation))
    amplitudes = [fitted(aligned, effect).theta[0] for effect in (TUBE, ANGLE)]
    sigma = compd.compare(aligned).floor.by_axis_um[1]
    left = []
    for truth_um, rival_um in (
        (amplitudes[0] * bend_um, cotangent_um),
        (amplitudes[1] * cotangent_um, bend_um),
    ):
        A = np.stack([rival_um, np.ones_like(rival_um)], axis=1)  # a constant is fitted along
        theta, *_ = np.linalg.lstsq(A, truth_um, rcond=None)
        left.append(np.linalg.norm(truth_um - A @ theta) / sigma)
    assert plan.separation == pytest.approx(min(left), rel=0.02)


def test_a_difference_that_a_constant_imitates_is_worth_nothing(tmp_path: Path) -> None:
    aligned = telescope(tmp_path / "sky.csv")
    plan = compd.plan_measurement(aligned, ("zero", "tube"), effects=[ZERO, TUBE], limits={"elevation_deg": (20, 85)})
    assert plan.separation == pytest.approx(0.0, abs=1e-3)
    assert not plan.tells_apart
    assert "a constant" in plan.summary
    answer = next_measurement(aligned, (), fitted(aligned, TUBE), ZERO, sigma_um(aligned))
    assert answer.plan is None
    (words,) = answer.as_json()
    assert set(words) == {"measure", "why"}
    assert all(words.values())


def test_effects_beside_are_fitted_along_and_their_columns_varied(tmp_path: Path) -> None:
    aligned = telescope(tmp_path / "sky.csv")
    tilt = along("y", "tilt", "k * cos(0.0174532925 * azimuth_deg)")
    plan = compd.plan_measurement(aligned, ("tube", "angle"), effects=[TUBE, ANGLE, tilt], beside=["tilt"], rows=20)
    assert {"azimuth_deg", "elevation_deg"} < set(plan.rows[0])
    assert len({row["azimuth_deg"] for row in plan.rows}) > 1


def test_directions_and_places_of_a_stage(tmp_path: Path) -> None:
    aligned = stage(tmp_path / "stage.csv")
    limits = {"tip_x_mm": (10.0, 100.0)}
    plan = compd.plan_measurement(aligned, ("play", "windup"), effects=[PLAY, WINDUP], rows=12, limits=limits)
    assert {row["moved_1"] for row in plan.rows} == {-1, 1}
    assert {row["tip_x_mm"] for row in plan.rows} >= {10, 100}
    assert plan.separation > plan.before + 1


def test_an_effect_that_remembers_is_parted_by_steps_that_are_watched(tmp_path: Path) -> None:
    aligned = printer(tmp_path / "bed.csv")
    plan = compd.plan_measurement(aligned, ("bed", "bed_later"), effects=[BED, BED_LATER], rows=12)
    assert plan.tells_apart
    steps = [row for row in plan.rows if row["purpose"] == "a step of temperature_bed_degC, watched"]
    assert len(steps) >= 6
    assert max(row["time_s"] for row in steps) >= 600
    assert "time_s" in plan.instructions
    # where nothing is watched, both are the same
    still = next_measurement(
        aligned, (), fitted(aligned, BED), BED_LATER, sigma_um(aligned), criteria=PlanningCriteria(rows=4)
    )
    assert still.plan is None


def test_what_changes_with_time_is_measured_again_later(tmp_path: Path) -> None:
    aligned = printer(tmp_path / "bed.csv")
    drift = along("z", "drift", "k * time_s / 3600")
    plan = compd.plan_measurement(aligned, ("bed", "drift"), effects=[BED, drift], rows=12)
    assert plan.tells_apart
    again = measurement_to_test(aligned, (), drift, sigma_um(aligned))
    assert again.plan is not None
    assert {row["purpose"] for row in again.plan.rows} == {"the same settings again later"}


def test_derivatives_of_the_model_are_planned_at_recorded_rows(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    names = ("radius", "offset")
    columns = {f"d_{name}_{axis}_mm": rng.normal(size=ROWS) for name in names for axis in "xy"}
    columns["angle_deg"] = rng.uniform(0, 90, ROWS)
    errors = {axis: 3 * columns[f"d_radius_{axis}_mm"] for axis in "xy"}
    aligned = record_external(tmp_path / "arm.csv", columns, errors)
    parameters = {"k": {"unit": "um", "plausible": [-1, 1], "source": "a test"}}
    effects = [
        formula_effect({"id": name, "port": "reference", "sensitivity": name, "parameters": parameters}, "a test")
        for name in names
    ]
    plan = compd.plan_measurement(aligned, names, effects=effects, rows=6)
    assert len(plan.rows) == 6
    for row in plan.rows:
        number = int(row["purpose"].split()[1])
        assert row["purpose"] == f"row {number} of arm.csv again"
        assert row["angle_deg"] == pytest.approx(columns["angle_deg"][number - 2])
        assert not any(name.startswith("d_") for name in row)


def test_links_of_an_external_model_are_reversed_in_growing_steps(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    scale = rng.uniform(0, 80, ROWS)
    approach = rng.choice([-1.0, 1.0], ROWS)
    reference = scale + 1e-3 * (2 * approach + rng.normal(0, SIGMA_UM, ROWS))
    table = np.stack([10.0 * np.arange(ROWS), scale, approach, scale, reference], axis=1)
    header = "time_s,scale_1_mm,approach_1,model_link_1_mm,reference_link_1_mm"
    np.savetxt(tmp_path / "axis.csv", table, delimiter=",", header=header, comments="", fmt="%.9g")
    sidecar = f"{{machine: external, reference: {{quantity: link_length, sigma_um: {SIGMA_UM}}}}}"
    (tmp_path / "axis.yaml").write_text(sidecar)
    aligned = compd.open_recording(tmp_path / "axis.csv")
    play, friction = (
        FittedEffect(load_library()[name], np.array([2.0]), constants)
        for name, constants in (("backlash", {}), ("friction_hysteresis", {"d": 5.0, "r": 0.0}))
    )
    plan = plan_measurement(aligned, (), (friction, play), sigma_um(aligned), {}, rows=26)
    assert plan.tells_apart
    reversals = [row for row in plan.rows if row["purpose"] == "reversals of scale_1_mm in growing steps"]
    assert {row["approach_1"] for row in reversals} == {-1, 1}
    assert len({row["scale_1_mm"] for row in reversals}) > 10
    loaded = compd.plan_measurement(aligned, ("backlash", "scale_gain"), rows=8)
    assert all(scale.min() <= row["scale_1_mm"] <= scale.max() for row in loaded.rows)


def test_places_are_set_where_the_instruments_frame_is_fitted_along(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    place = {axis: rng.uniform(-100, 100, ROWS) for axis in "xyz"}
    scale, bow = along("x", "scale", "k * tip_x_mm / 100"), along("x", "bow", "k * (tip_x_mm / 100) ** 2")
    errors = {"x": 10 * place["x"] / 100, "y": np.zeros(ROWS), "z": np.zeros(ROWS)}
    aligned = record_external(tmp_path / "gantry.csv", {}, errors, model_mm=place, frame="instrument")
    plan = compd.plan_measurement(aligned, ("scale", "bow"), effects=[scale, bow], rows=12)
    assert {"tip_x_mm", "tip_y_mm", "tip_z_mm"} < set(plan.rows[0])
    assert plan.separation > plan.before


@pytest.mark.parametrize(
    ("limits", "message"),
    [
        ({"azimuth_deg": (0.0, 90.0)}, "is no column that these effects are computed from"),
        ({"elevation_deg": (60.0, 40.0)}, "two numbers, low first"),
    ],
)
def test_faulty_limits_are_refused(tmp_path: Path, limits: dict[str, tuple[float, float]], message: str) -> None:
    aligned = telescope(tmp_path / "sky.csv")
    with pytest.raises(CompdError, match=message):
        compd.plan_measurement(aligned, ("tube", "angle"), effects=[TUBE, ANGLE], limits=limits)


def test_limits_of_the_other_kind_of_machine_are_refused_all_at_once(tmp_path: Path) -> None:
    aligned = telescope(tmp_path / "sky.csv")
    with pytest.raises(CompdError) as error:
        compd.plan_measurement(aligned, ("tube", "angle"), effects=[TUBE, ANGLE], force_N=3, temperature_degC=(10, 20))
    assert [problem.where for problem in error.value.problems] == ["temperature_degC", "force_N"]
    assert "--limit" in error.value.problems[0].next_step


def test_where_nothing_was_varied_the_plan_says_so(tmp_path: Path) -> None:
    columns = {"humidity_pct": np.full(ROWS, 40.0)}
    aligned = record_external(tmp_path / "dry.csv", columns, {"x": np.zeros(ROWS)})
    swelling = along("x", "swelling", "k * humidity_pct"), along("x", "softening", "k * humidity_pct ** 2")
    with pytest.raises(CompdError, match="nothing that these effects are computed from was varied"):
        compd.plan_measurement(aligned, ("swelling", "softening"), effects=swelling)
    answer = next_measurement(aligned, (), fitted(aligned, swelling[0]), swelling[1], sigma_um(aligned))
    assert answer.plan is None
    assert "was varied" in answer.why


def test_rows_for_rivals_of_a_diagnosis(tmp_path: Path) -> None:
    aligned = telescope(tmp_path / "sky.csv", elevation_deg=(20.0, 85.0))
    answer = next_measurement(aligned, (), fitted(aligned, TUBE), ANGLE, sigma_um(aligned))
    assert answer.effects == ("tube", "angle")
    assert answer.plan is not None
    assert answer.as_json() == [dict(row) for row in answer.plan.rows]
    assert "The rows under 'next' can" in answer.promise


def test_rivals_that_no_recorded_setting_parts_get_words(tmp_path: Path) -> None:
    aligned = telescope(tmp_path / "sky.csv", elevation_deg=(49.0, 51.0))
    answer = next_measurement(aligned, (), fitted(aligned, TUBE), ANGLE, sigma_um(aligned))
    assert answer.plan is None
    assert "The rows" not in answer.promise
    assert answer.measure == TUBE.separated_by
    assert "it takes 3" in answer.why


def test_an_effect_without_its_column_is_told_what_to_record(tmp_path: Path) -> None:
    aligned = telescope(tmp_path / "sky.csv")
    wind = along("y", "wind", "k * wind_m_per_s")
    answer = measurement_to_test(aligned, (), wind, sigma_um(aligned))
    assert answer.plan is None
    assert answer.measure == "read a gauge along and record a column `wind_m_per_s`"
    assert "wind_m_per_s" in answer.why


def test_an_effect_whose_column_never_changed_is_told_to_vary_it(tmp_path: Path) -> None:
    aligned = record_external(tmp_path / "dry.csv", {"humidity_pct": np.full(ROWS, 40.0)}, {"x": np.zeros(ROWS)})
    answer = measurement_to_test(aligned, (), along("x", "swelling", "k * humidity_pct"), sigma_um(aligned))
    assert (answer.measure, answer.why) == ("vary humidity_pct", "humidity_pct stayed at 40")


def test_causes_of_a_constant_are_parted_by_rows_on_which_they_vary(tmp_path: Path) -> None:
    columns = {"moved_1": np.ones(ROWS), "position_mm": np.linspace(0, 100, ROWS), "elevation_deg": np.full(ROWS, 45.0)}
    columns["elevation_deg"][:6] = np.linspace(30, 60, 6)
    aligned = record_external(tmp_path / "offset.csv", columns, {"x": np.full(ROWS, 8.0)})
    homing, slope = along("x", "homing", "k"), along("x", "slope", f"k * cos{RAD}")
    answer = measurement_of_constant(aligned, (), [homing, slope], np.array([8.0]), sigma_um(aligned))
    assert answer.plan is not None
    assert set(answer.plan.rivals) == {"a constant", "homing", "slope"}
    assert len({row["elevation_deg"] for row in answer.plan.rows}) > 1
    nothing = measurement_of_constant(aligned, (), [homing], np.array([8.0]), sigma_um(aligned))
    assert nothing.plan is None
    assert nothing.measure == homing.separated_by


def test_the_plans_file_has_the_settings(tmp_path: Path) -> None:
    aligned = stage(tmp_path / "stage.csv")
    plan = compd.plan_measurement(aligned, ("play", "windup"), effects=[PLAY, WINDUP], rows=8)
    plan.write(tmp_path / "next.csv")
    with (tmp_path / "next.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert list(rows[0]) == ["row", "purpose", "time_s", "moved_1", "tip_x_mm"]
    assert {row["moved_1"] for row in rows} == {"-1", "1"}


EFFECTS = """\
- {id: tube, port: reference, axis: y, formula: "k * cos(elevation_deg * pi / 180)", separated_by: the horizon,
   parameters: {k: {unit: um, plausible: [-100, 100], source: a test}}}
- {id: angle, port: reference, axis: y, formula: "k / sin(elevation_deg * pi / 180)", separated_by: the zenith,
   parameters: {k: {unit: um, plausible: [-100, 100], source: a test}}}
"""


def run_plan(tmp_path: Path, *options: str) -> Any:
    telescope(tmp_path / "sky.csv")
    (tmp_path / "own.yaml").write_text(EFFECTS, encoding="utf-8")
    commands = typer.Typer()
    commands.command("plan")(plan_command)
    arguments = [str(tmp_path / "sky.csv"), "--effects", str(tmp_path / "own.yaml"), "--rivals", "tube,angle"]
    return CliRunner().invoke(commands, [*arguments, *options])


def test_the_command_writes_the_settings_and_says_what_to_set(tmp_path: Path) -> None:
    out = tmp_path / "next.csv"
    result = run_plan(tmp_path, "--limit", "elevation_deg=20,85", "--rows", "12", "--out", str(out))
    assert result.exit_code == 0, result.output
    assert "The errors from tube and angle differ by" in result.output
    assert "Set elevation_deg from 20 to 85." in result.output
    lines = out.read_text().splitlines()
    assert lines[0] == "row,purpose,time_s,elevation_deg"
    assert len(lines) == 13


def test_the_command_says_where_no_rows_within_the_limits_would_do(tmp_path: Path) -> None:
    result = run_plan(tmp_path, "--rows", "4")
    assert result.exit_code == 0, result.output
    assert "Widen the limits" in result.output
    assert "the horizon; the zenith" in result.output


def test_the_command_refuses_a_limit_of_a_column_that_does_not_matter(tmp_path: Path) -> None:
    result = run_plan(tmp_path, "--limit", "humidity_pct=20,85")
    assert isinstance(result.exception, CompdError)
    assert "limit of humidity_pct" in str(result.exception)
    assert "elevation_deg" in str(result.exception)
