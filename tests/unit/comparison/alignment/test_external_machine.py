"""Machines of which only a model's prediction is known: what effects see of them, with and without time."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import compd
from compd.comparison.alignment.aligned_recording import AlignedRecording
from compd.comparison.covariate import covariates
from compd.errors import CompdError
from compd.model.formula import formula_effect
from compd.recording import read_recording

Floats = NDArray[np.float64]
ROWS = 120
PARAMETER = {"unit": "um", "plausible": [-1, 1], "source": "drawing"}
TIP = "machine: external\nreference: {quantity: tool_position, frame: machine, sigma_um: 0.2}\n"
LINKS = "machine: external\nreference: {quantity: link_length, sigma_um: 0.2}\n"


def write(path: Path, sidecar: str, columns: Mapping[str, Floats]) -> Path:
    """A recording of these columns, as a person's program writes it."""
    lines = [",".join(columns)]
    lines += [
        ",".join("" if np.isnan(cell) else repr(float(cell)) for cell in row)
        for row in zip(*columns.values(), strict=True)
    ]
    path.write_text("\n".join(lines) + "\n")
    path.with_suffix(".yaml").write_text(sidecar)
    return path


def axis_columns(**more: Floats) -> dict[str, Floats]:
    """A link measured with an interferometer: backlash 4 um, gain 30 ppm, an expansion of 11.5 ppm/K."""
    rng = np.random.default_rng(4)
    position_mm = rng.uniform(-50, 50, ROWS)
    direction = np.where(np.diff(position_mm, prepend=0.0) > 0, 1.0, -1.0)
    temperature = 20 + 2 * np.sin(np.arange(ROWS) / 40)
    error_um = -2.0 * direction + 0.03 * position_mm + 0.0115 * position_mm * (temperature - 20)
    return {
        "time_s": 30.0 * np.arange(ROWS),
        "scale_1_mm": position_mm,
        "approach_1": direction,
        "temperature_link_1_degC": temperature,
        "model_link_1_mm": position_mm,
        "reference_link_1_mm": position_mm + 1e-3 * (error_um + rng.normal(0, 0.2, ROWS)),
        **more,
    }


def without(columns: Mapping[str, Floats], *names: str) -> dict[str, Floats]:
    return {name: values for name, values in columns.items() if name not in names}


def opened(path: Path, sidecar: str, columns: Mapping[str, Floats]) -> AlignedRecording:
    return compd.open_recording(write(path, sidecar, columns))


def test_the_scale_of_a_measured_link_is_fitted_as_that_of_a_known_machine(tmp_path: Path) -> None:
    aligned = opened(tmp_path / "axis.csv", LINKS, axis_columns())
    model = None
    for effect in ("backlash", "scale_gain", "scale_expansion"):
        model = compd.add_effect(model, effect, aligned)
    assert model is not None
    numbers = {number.effect: number.value for number in model.numbers()}
    assert numbers["backlash"] == pytest.approx(4.0, abs=0.15)
    assert numbers["scale_gain"] == pytest.approx(30.0, abs=2.0)
    assert numbers["scale_expansion"] == pytest.approx(11.5, abs=1.5)
    assert compd.compare(aligned, model).rms_um == pytest.approx(0.2, rel=0.2)
    model.write(tmp_path / "axis.model.yaml")
    again = compd.open_model(tmp_path / "axis.model.yaml")
    assert (again.links, [number.parameter for number in again.numbers()]) == (1, ["b_1", "k_1", "a"])


def test_a_direction_that_was_recorded_without_a_scale_is_enough_for_backlash(tmp_path: Path) -> None:
    aligned = opened(tmp_path / "axis.csv", LINKS, without(axis_columns(), "scale_1_mm"))
    diagnosis = compd.diagnose(aligned)
    why = {candidate.effect: candidate.why for candidate in diagnosis.candidates}
    assert "scales, which were not recorded" in why["scale_gain"]
    assert "which was not recorded" not in why["backlash"]
    assert "backlash" in [step.effect.id for step in diagnosis.steps]


def test_a_direction_that_was_not_recorded_comes_from_the_scale(tmp_path: Path) -> None:
    columns = axis_columns()
    aligned = opened(tmp_path / "axis.csv", LINKS, without(columns, "approach_1"))
    np.testing.assert_array_equal(aligned.rows.direction[1:, 0], columns["approach_1"][1:])
    names = [covariate.name for covariate in covariates(aligned)]
    assert names == ["time", "scale_1", "temperature_link_1", "direction of link 1"]


def test_effects_inside_the_machine_are_no_candidates_and_effects_of_ones_own_are(tmp_path: Path) -> None:
    aligned = opened(tmp_path / "axis.csv", LINKS, axis_columns())
    inside = {
        "id": "mine",
        "port": "tool",
        "axis": "x",
        "formula": "k",
        "parameters": {"k": PARAMETER},
    }
    diagnosis = compd.diagnose(aligned, effects=formula_effect(inside, "mine.yaml"))
    names = {candidate.effect: candidate.why for candidate in diagnosis.candidates}
    scales = {"scale_gain", "scale_expansion", "scale_cyclic", "backlash", "friction_hysteresis", "gauge_latency"}
    assert set(names) == {*scales, "link_zero", "mine"}
    assert "acts at the port tool, which an external model has not" in names["mine"]


def stage(**more: Floats) -> dict[str, Floats]:
    """A stage of one axis whose scale, direction and speed are columns like any other."""
    rng = np.random.default_rng(5)
    position_mm, moved = rng.uniform(0, 100, ROWS), rng.choice([-1.0, 1.0], ROWS)
    speed = rng.choice([0.0, 10.0, 40.0], ROWS)
    error_um = 1.5 * moved - 0.05 * speed * moved
    return {
        "time_s": 10.0 * np.arange(ROWS),
        "scale_1_mm": position_mm,
        "approach_1": moved,
        "velocity_1_mm_per_s": speed * moved,
        "model_x_mm": position_mm,
        "reference_x_mm": position_mm + 1e-3 * (error_um + rng.normal(0, 0.1, ROWS)),
        **more,
    }


def test_formulas_see_scale_direction_and_speed_of_a_stage(tmp_path: Path) -> None:
    (tmp_path / "stage.yaml").write_text(
        """\
- {id: stage_backlash, port: reference, axis: x, formula: "b / 2 * approach_1",
   parameters: {b: {unit: um, plausible: [-20, 20], source: screw}}}
- {id: stage_latency, port: reference, axis: x, formula: "-tau * velocity_1_mm_per_s",
   parameters: {tau: {unit: ms, plausible: [0, 1], source: controller}}}
- {id: stage_cyclic, port: reference, axis: x, formula: "a * sin(2 * pi * scale_1_mm / p)",
   parameters: {a: {unit: um, plausible: [-20, 20], source: screw}, p: {unit: mm, plausible: [1, 10], source: screw}}}
- {id: stage_lag, port: reference, axis: x, formula: "k * lag(approach_1, tau)",
   parameters: {k: {unit: um, plausible: [-20, 20], source: "-"}, tau: {unit: s, plausible: [10, 1000], source: "-"}}}
"""
    )
    aligned = opened(tmp_path / "run.csv", TIP, stage())
    diagnosis = compd.diagnose(aligned, effects=tmp_path / "stage.yaml")
    assert {step.effect.id for step in diagnosis.steps} == {"stage_backlash", "stage_latency"}
    fitted = {step.effect.id: step.parameters[0].value for step in diagnosis.steps}
    assert fitted["stage_backlash"] == pytest.approx(3.0, abs=0.1)
    assert fitted["stage_latency"] == pytest.approx(0.05, abs=0.005)
    names = [covariate.name for covariate in covariates(aligned)]
    assert names == ["time", "x", "scale_1", "direction of axis 1", "velocity_1"]


def test_an_empty_cell_of_a_gauge_leaves_out_no_row_of_an_external_model(tmp_path: Path) -> None:
    columns = stage()
    columns["scale_1_mm"] = np.where(np.arange(ROWS) == 7, np.nan, columns["scale_1_mm"])
    aligned = opened(tmp_path / "run.csv", TIP, columns)
    assert aligned.usable.mask.all()


def test_rows_without_time_count_in_order_and_effects_that_need_it_say_so(tmp_path: Path) -> None:
    path = write(tmp_path / "run.csv", TIP, without(stage(), "time_s"))
    recording = read_recording(path)
    assert not recording.has_time
    assert "time_s" not in recording.columns
    np.testing.assert_array_equal(recording.time_s, np.arange(ROWS))
    assert len(set(recording.fold.tolist())) == 8
    aligned = compd.open_recording(path)
    assert "without time" in str(aligned)
    diagnosis = compd.diagnose(aligned)
    why = {candidate.effect: candidate.why for candidate in diagnosis.candidates}
    assert why["reference_drift"] == "needs the time of each row, which was not recorded"
    assert "time" not in [covariate.name for covariate in covariates(aligned)]
    lagged = {
        "id": "lagged",
        "port": "reference",
        "axis": "x",
        "formula": "k * lag(approach_1, 60)",
        "parameters": {"k": PARAMETER},
    }
    with pytest.raises(CompdError, match="record a column `time_s`"):
        compd.add_effect(None, lagged, aligned)


def test_a_sensitivity_belongs_to_its_effect_and_to_nothing_else(tmp_path: Path) -> None:
    rng = np.random.default_rng(6)
    derivative = rng.uniform(-1, 1, ROWS)
    columns = stage(d_pitch_x_mm=derivative)
    columns["reference_x_mm"] = columns["model_x_mm"] + 0.02 * derivative + rng.normal(0, 1e-4, ROWS)
    aligned = opened(tmp_path / "run.csv", TIP, columns)
    pitch = {
        "id": "pitch",
        "port": "reference",
        "sensitivity": "pitch",
        "parameters": {"dp": PARAMETER},
    }
    model = compd.add_effect(None, pitch, aligned)
    (number,) = model.numbers()
    assert number.value == pytest.approx(0.02, abs=1e-4)
    assert "d_pitch_x_mm" in aligned.recording.quantities
    assert not any("pitch" in covariate.name for covariate in covariates(aligned))
    diagnosis = compd.diagnose(aligned, effects=formula_effect(pitch, "pitch.yaml"))
    assert [step.effect.id for step in diagnosis.steps] == ["pitch"]


def test_a_sensitivity_is_in_the_unit_of_the_reference(tmp_path: Path) -> None:
    rng = np.random.default_rng(8)
    derivative = rng.uniform(-1, 1, ROWS)  # arcsec per urad
    columns = {
        "d_tilt_x_arcsec": derivative,
        "model_x_arcsec": np.zeros(ROWS),
        "reference_x_arcsec": 30.0 * derivative + rng.normal(0, 0.2, ROWS),
    }
    sidecar = "machine: external\nreference: {quantity: tool_position, unit: arcsec, frame: machine, sigma: 0.2}\n"
    aligned = opened(tmp_path / "run.csv", sidecar, columns)
    tilt = {
        "id": "tilt",
        "port": "reference",
        "sensitivity": "tilt",
        "parameters": {"t": {**PARAMETER, "unit": "urad"}},
    }
    (number,) = compd.add_effect(None, tilt, aligned).numbers()
    assert number.value == pytest.approx(30.0, abs=0.2)
    assert [covariate.name for covariate in covariates(aligned)] == ["x"]
