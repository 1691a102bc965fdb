"""The public functions on a small recording: what they take, how they refuse, and their results as tables."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import compd
from compd.comparison import AlignedRecording, Comparison
from compd.diagnosis import Diagnosis
from compd.errors import CompdError, ConfigurationError, PluginError, RecordingError, StateError
from compd.model.effects import Effect, Parameter
from compd.model_file import ModelFile
from compd.planning import MeasurementPlan
from compd.result_tables import MAX_ROWS, data_frame, html_table
from tests.support.measured import SIGMA_UM, gauges, hidden, record

ROWS = 300
FORMULA = {
    "id": "my_growth",
    "port": "reference",
    "axis": "z",
    "formula": "k * (temperature_room_degC - 20)",
    "parameters": {"k": {"unit": "um/K", "plausible": [-5, 5], "source": "<b>my notes</b>"}},
}
# One column name of each table and its unit is in its name; "unit" is a column of its own in a model's table.
UNITS = ("_mm", "_um", "_degC", "_N", "_pct", "_s", "_mm_per_s", "_hPa")
NO_UNIT = {
    "row", "session", "visit", "used", "outlier", "why_left_out", "purpose", "effect", "found", "status", "why",
    "explained_fraction", "p_value", "parameter", "value", "standard_error", "unit", "plausible_low",
    "plausible_high", "searched", "column", "gauge", "driver", "line", "link", "sign",
}  # fmt: skip


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A tripod's recording with link_expansion hidden, an empty cell, an outlier, and a row that a person excluded."""
    columns = gauges(ROWS, 31)
    written = record(tmp_path_factory.mktemp("run"), columns, [hidden("link_expansion", 1.1)])
    lines = written.read_text(encoding="utf-8").splitlines()
    names = lines[0].split(",")
    for row, column, text in ((10, "reference_y_mm", ""), (21, "reference_x_mm", "500")):
        cells = lines[row - 1].split(",")
        cells[names.index(column)] = text
        lines[row - 1] = ",".join(cells)
    written.write_text("\n".join(lines) + "\n", encoding="utf-8")
    with written.with_suffix(".yaml").open("a", encoding="utf-8") as sidecar:
        sidecar.write("excluded_rows:\n- {row: 31, reason: the beam was cut}\n")
    return written


@pytest.fixture(scope="module")
def recording(path: Path) -> AlignedRecording:
    return compd.open_recording(path)


@pytest.fixture(scope="module")
def comparison(recording: AlignedRecording) -> Comparison:
    return compd.compare(recording)


@pytest.fixture(scope="module")
def diagnosis(recording: AlignedRecording) -> Diagnosis:
    return compd.diagnose(recording)


@pytest.fixture(scope="module")
def model(recording: AlignedRecording, diagnosis: Diagnosis) -> ModelFile:
    return compd.add_effect(None, diagnosis.steps[0].effect, recording)


@pytest.fixture(scope="module")
def plan(recording: AlignedRecording) -> MeasurementPlan:
    return compd.plan_measurement(recording, ("link_elasticity", "joint_contact"), rows=12, force_N=90.0)


def test_paths_are_text_or_path_and_files_may_be_open_or_not(
    path: Path, recording: AlignedRecording, model: ModelFile, tmp_path: Path
) -> None:
    model.write(str(tmp_path / "model.yaml"))
    model.write(tmp_path / "model.yaml")
    expected = compd.compare(recording, model).rms_um
    for given in (path, str(path), compd.open_recording(str(path), machine="tripod-cmm")):
        for file in (str(tmp_path / "model.yaml"), tmp_path / "model.yaml"):
            assert compd.compare(given, file).rms_um == pytest.approx(expected, rel=1e-9)
    opened = compd.open_model(tmp_path / "model.yaml")
    assert opened.steps == model.steps
    assert opened.numbers() == model.numbers()
    assert compd.open_model(str(tmp_path / "model.yaml"), machine="tripod-cmm").numbers() == model.numbers()


def test_the_error_falls_to_the_floor_and_the_ledger_says_so(recording: AlignedRecording, model: ModelFile) -> None:
    (step,) = model.steps
    after = compd.compare(recording, model)
    assert step.rms_after_um == after.rms_um < 1.1 * after.floor.um < step.rms_before_um
    assert step.recording == "run.csv"
    assert model.geometry == recording.geometry_hash
    (value,) = model.numbers()
    assert value.value == pytest.approx(1.1, abs=4 * value.standard_error)


def test_a_model_keeps_the_range_that_it_was_fitted_in(
    recording: AlignedRecording, model: ModelFile, tmp_path: Path
) -> None:
    assert list(model.fitted_range) == [f"temperature_link_{i}_degC" for i in (1, 2, 3)]
    for name, (low, high) in model.fitted_range.items():
        values = recording.rows.quantities[name][recording.usable.mask]
        assert low == values.min() < values.max() == high
    model.write(tmp_path / "model.yaml")
    opened = compd.open_model(tmp_path / "model.yaml")
    assert (opened.fitted_range, opened.warnings) == (model.fitted_range, ())


def test_adding_changes_nothing_of_the_model_before(recording: AlignedRecording, model: ModelFile) -> None:
    longer = compd.add_effect(model, FORMULA, recording)
    assert [step.effect for step in longer.steps] == ["link_expansion", "my_growth"]
    assert [step.effect for step in model.steps] == ["link_expansion"]


def test_an_effect_is_an_id_a_formula_or_its_file(recording: AlignedRecording, tmp_path: Path) -> None:
    written = tmp_path / "growth.yaml"
    written.write_text(
        'id: my_growth\nport: reference\naxis: z\nformula: "k * (temperature_room_degC - 20)"\n'
        'parameters: {k: {unit: um/K, plausible: [-5, 5], source: "<b>my notes</b>"}}\n',
        encoding="utf-8",
    )
    by_file = [compd.add_effect(None, given, recording) for given in (FORMULA, written, str(written))]
    assert len({model.numbers()[0].value for model in by_file}) == 1
    assert compd.add_effect(None, "link_expansion", recording).declared == ("link_expansion",)


def test_own_effects_are_tried_beside_the_library(recording: AlignedRecording) -> None:
    own = Effect(
        id="my_expansion",
        ports=("tool",),
        physics="The tool grows with the room.",
        equation="delta = a dT",
        symbols={},
        source="",
        needs=("temperature_room_degC",),
        parameters=(Parameter("a", "um/K", -5, 5, ""),),
        mistaken_for=(),
        separated_by="",
        basis=compd.memoryless_basis(
            lambda rows, constants: np.stack([np.zeros(len(rows))] * 2 + [1e-3 * rows.warming_K("room")], axis=1)[
                :, :, None
            ]
        ),
    )
    stages: list[str] = []
    diagnosis = compd.diagnose(recording, effects=[own], progress=stages.append)
    assert "my_expansion" in [candidate.effect for candidate in diagnosis.candidates]
    assert stages
    with pytest.raises(CompdError, match="not installed") as error:
        compd.add_effect(None, own, recording)
    assert "file.py" in error.value.problems[0].next_step


@pytest.mark.parametrize(
    ("kind", "said", "call"),
    [
        (RecordingError, "none.csv", lambda recording, model: compd.compare("none.csv")),
        (StateError, "none.yaml", lambda recording, model: compd.compare(recording, "none.yaml")),
        (StateError, "none.yaml", lambda recording, model: compd.open_model("none.yaml")),
        (ConfigurationError, "tripod-cmm", lambda recording, model: compd.open_recording("none.csv", machine="tri")),
        (PluginError, "no such effect", lambda recording, model: compd.add_effect(model, "expansion", recording)),
        (StateError, "in the model already", lambda r, model: compd.add_effect(model, "link_expansion", r)),
        (CompdError, "two effects", lambda recording, model: compd.plan_measurement(recording, ("link_zero",) * 2)),
        (
            CompdError,
            "in the model already",
            lambda recording, model: compd.plan_measurement(recording, ("link_expansion", "link_zero"), model=model),
        ),
    ],
)
def test_what_is_wrong_is_said_with_its_place_and_the_next_step(
    kind: type[CompdError], said: str, call: Any, recording: AlignedRecording, model: ModelFile
) -> None:
    with pytest.raises(kind, match=said) as error:
        call(recording, model)
    for problem in error.value.problems:
        assert problem.where
        assert problem.what
        assert problem.next_step or problem.allowed


def test_every_faulty_limit_is_reported_at_once(recording: AlignedRecording) -> None:
    with pytest.raises(CompdError) as error:
        compd.plan_measurement(
            recording,
            ("link_elasticity", "joint_contact"),
            workspace_M_mm=((0, 10), (10, 0), (0, 10)),
            temperature_degC=(25, 20),
            force_N=-1,
        )
    assert [problem.where for problem in error.value.problems] == ["workspace_M_mm, y", "temperature_degC", "force_N"]


def test_a_model_of_another_machine_is_refused(recording: AlignedRecording) -> None:
    with pytest.raises(StateError, match="another machine"):
        compd.compare(recording, ModelFile("hexapod", 6))


def test_limits_of_a_plan_are_kept(recording: AlignedRecording) -> None:
    box = ((-20.0, 20.0), (-10.0, 10.0), (130.0, 150.0))
    plan = compd.plan_measurement(
        recording, ("link_elasticity", "joint_contact"), rows=12, workspace_M_mm=box, force_N=50.0
    ).to_dataframe()
    for axis, (low, high) in zip("xyz", box, strict=True):
        assert plan[f"tip_{axis}_mm"].between(low - 1e-3, high + 1e-3).all()
        assert plan[f"force_{axis}_N"].abs().max() <= 50.0


def test_tables_have_a_row_for_each_thing_and_units_in_their_names(
    recording: AlignedRecording, comparison: Comparison, diagnosis: Diagnosis, model: ModelFile, plan: MeasurementPlan
) -> None:
    machine = compd.load_machine("tripod-cmm")
    tables = [thing.to_dataframe() for thing in (machine, recording, comparison, diagnosis, model, plan)]
    wires = machine.wiring
    channels = len(wires.scale) + len(wires.joint) + len(wires.frame) + len(wires.quantities)
    rows = [channels, ROWS, ROWS, len(diagnosis.candidates), len(model.numbers()), len(plan.rows)]
    assert [len(table) for table in tables] == rows
    for table in tables:
        for name in table.columns:
            assert name in NO_UNIT or name.endswith(UNITS) or name.startswith("approach_"), name


def test_the_comparison_says_for_each_row_why_it_is_not_used(comparison: Comparison) -> None:
    table = comparison.to_dataframe().set_index("row")
    why = table["why_left_out"]
    assert why[10] == "reference_y_mm is empty"
    assert why[21] == "beyond all noise"
    assert why[31] == "excluded by a person"
    assert (table["used"] == (why == "")).all()
    assert table.loc[10, ["residual_x_um", "residual_y_um", "residual_z_um"]].isna().all()
    assert table.loc[21, "residual_x_um"] > 1e5
    counts = {text: int(count) for text, count in why[why != ""].value_counts().items()}
    assert counts.pop("beyond all noise") == int(comparison.outlier.sum())
    assert counts == {text: count for text, count in comparison.left_out.items() if count}


def test_residuals_are_measured_less_predicted(recording: AlignedRecording, comparison: Comparison) -> None:
    rows, residual = recording.to_dataframe(), comparison.to_dataframe()
    difference_um = (rows["measured_z_mm"] - rows["predicted_z_mm"]) * 1e3
    used = residual["used"]
    assert np.allclose(difference_um[used], residual["residual_z_um"][used], atol=1e-9)
    assert np.isnan(rows["measured_y_mm"][8])


def test_what_is_not_known_is_nan(diagnosis: Diagnosis) -> None:
    table = diagnosis.to_dataframe()
    untried = table[table["status"] == "not_testable"]
    assert len(untried)
    assert untried["explained_fraction"].isna().all()
    assert table[table["found"]]["effect"].tolist() == ["link_expansion"]
    table = compd.load_machine("tripod-cmm").to_dataframe().set_index("column")["noise_um"]
    assert table["scale_1_mm"] == 0.03
    assert table[[name for name in table.index if name.endswith("_degC")]].isna().all()


def test_a_searched_constant_has_no_standard_error(recording: AlignedRecording) -> None:
    table = compd.add_effect(None, "link_expansion_lag", recording).to_dataframe().set_index("parameter")
    assert table.loc["tau", "searched"]
    assert np.isnan(table.loc["tau", "standard_error"])
    assert table.loc["a", "standard_error"] > 0


def test_without_pandas_the_next_step_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(CompdError, match="pandas is not installed") as error:
        data_frame({"a": [1]})
    assert "compd[notebook]" in error.value.problems[0].next_step


def test_every_result_shows_its_verdict_first_and_names_itself_in_a_line(
    recording: AlignedRecording, comparison: Comparison, diagnosis: Diagnosis, model: ModelFile, plan: MeasurementPlan
) -> None:
    firsts = [
        (compd.load_machine("tripod-cmm"), "tripod-cmm"),
        (recording, "run.csv"),
        (comparison, "tripod-cmm: measured and modelled differ"),
        (diagnosis, "identified: What is missing is link_expansion"),
        (model, "Model of tripod-cmm"),
        (plan, "The errors from link_elasticity and joint_contact"),
    ]
    for thing, begin in firsts:
        text = thing._repr_html_()
        assert text.split("<strong>")[1].startswith(begin)
        assert "<table" in text
        assert len(text) < 20_000
        for outside in ("<script", "src=", "href=", "url("):
            assert outside not in text
        assert len(repr(thing).splitlines()) == 1


def test_html_is_escaped() -> None:
    text = html_table("<script>alert(1)</script>", {"<i>": ["<b>x</b>"], "n_um": [float("nan")]}, ["a & <u>b</u>"])
    assert "<script>" not in text
    assert "&lt;script&gt;" in text
    assert "&lt;b&gt;x&lt;/b&gt;" in text
    assert "&lt;i&gt;" in text
    assert "a &amp; &lt;u&gt;b&lt;/u&gt;" in text
    assert "nan" not in text


def test_html_of_results_escapes_what_people_wrote(path: Path, tmp_path: Path) -> None:
    evil = tmp_path / "<img src=x>.csv"
    evil.write_bytes(path.read_bytes())
    evil.with_suffix(".yaml").write_bytes(path.with_suffix(".yaml").read_bytes())
    recording = compd.open_recording(evil)
    model = compd.add_effect(None, FORMULA, recording)
    assert "<img" not in recording._repr_html_() + model._repr_html_()
    assert "&lt;img" in recording._repr_html_()
    assert "&lt;img" in model._repr_html_()


def test_long_tables_are_cut_in_a_notebook_and_say_so() -> None:
    text = html_table("", {"row": list(range(MAX_ROWS + 3))})
    assert text.count("<tr ") == MAX_ROWS + 1
    assert "3 more rows" in text


def test_recordings_of_links_name_their_columns(tmp_path: Path) -> None:
    external = tmp_path / "arm.csv"
    rows = "".join(f"{k},0,{k % 5 * 1e-3:g}\n" for k in range(60))
    external.write_text(f"time_s,model_link_1_mm,reference_link_1_mm\n{rows}", encoding="utf-8")
    external.with_suffix(".yaml").write_text(
        f"machine: external\nreference: {{quantity: link_length, sigma_um: {SIGMA_UM}}}\n", encoding="utf-8"
    )
    recording = compd.open_recording(external)
    assert "measured_link_1_mm" in recording.to_dataframe()
    assert "residual_link_1_um" in compd.compare(recording).to_dataframe()
