"""`compd compare`, `compd model add | remove | fit | undo`, `compd model ledger`, as a person types them."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
import typer
import yaml
from typer.testing import CliRunner

from compd.cli.measurements.compare import compare
from compd.cli.measurements.model.effect import add, fit, remove, undo
from compd.cli.measurements.model.ledger import ledger
from compd.errors import CompdError, RecordingError, StateError
from compd.model_file import read_model_file
from tests.support.external import write_external
from tests.support.measured import gauges, hidden, record

# The unit as a word; the names of columns and keys keep theirs.
UM = re.compile(r"(?<![\w.{])um(?![\w}])")

app = typer.Typer()
for command in (compare, ledger, add, remove, fit, undo):
    app.command()(command)


def run(*arguments: object) -> str:
    """The output of a command that must succeed."""
    result = CliRunner().invoke(app, [str(argument) for argument in arguments], catch_exceptions=False)
    assert result.exit_code == 0
    return result.output


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    return record(tmp_path, gauges(300, 21), [hidden("link_expansion", 1.1)])


def test_json_has_the_binding_keys(recording: Path) -> None:
    found = json.loads(run("compare", recording, "--json"))
    wanted = {
        "residual_rms_um",
        "residual_rms_xyz_um",
        "noise_floor_um",
        "noise_floor_source",
        "floor_ratio",
        "rows_used",
        "rows_excluded",
        "contributions",
    }
    assert wanted <= set(found)
    assert found["floor_ratio"] == pytest.approx((found["residual_rms_um"] / found["noise_floor_um"]) ** 2)
    assert set(found["contributions"]) == {"joints", "frame"}


def test_several_recordings_side_by_side(recording: Path, tmp_path: Path) -> None:
    other = record(tmp_path, gauges(100, 22), name="other")
    found = json.loads(run("compare", recording, other, "--json"))
    assert [one["at_floor"] for one in found["recordings"]] == [False, True]
    table = run("compare", recording, other)
    assert "run.csv" in table
    assert "other.csv" in table


def test_the_page_has_the_same_panels_every_time_and_asks_for_no_network(recording: Path, tmp_path: Path) -> None:
    columns = {"time_s": gauges(60, 23)["time_s"], "model_z_mm": gauges(60, 23)["time_s"] * 0}
    external = tmp_path / "external.csv"
    external.write_text(
        "time_s,model_z_mm,reference_z_mm\n"
        + "".join(f"{t:g},0,{k % 5 * 1e-3:g}\n" for k, t in enumerate(columns["time_s"]))
    )
    external.with_suffix(".yaml").write_text(
        "machine: external\nreference: {quantity: tool_position, frame: machine}\n"
    )
    pages = []
    for path in (recording, external):
        page = tmp_path / "page.html"
        run("compare", path, "--html", page)
        pages.append(page.read_text())
    heads = [[part.split("</h2>")[0] for part in text.split("<h2>")[1:]] for text in pages]
    assert heads[0] == heads[1]
    assert "Residual vectors" in heads[0]
    assert "Residual pulled back to the links" in heads[0]
    for text in pages:
        assert "<script src" not in text
        assert "<link" not in text.split("<script>")[0]


def test_all_problems_of_all_recordings_come_at_once(recording: Path, tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / f"{name}.csv").write_text("time_s,scale_1_mm\n0,1;2\n")
    page = tmp_path / "page.html"
    result = CliRunner().invoke(app, ["compare", str(tmp_path / "a.csv"), str(tmp_path / "b.csv"), "--html", str(page)])
    assert isinstance(result.exception, CompdError)
    said = str(result.exception)
    assert "a.yaml" in said
    assert "b.yaml" in said
    assert not page.exists()


def test_compare_add_compare_again(recording: Path, tmp_path: Path) -> None:
    other = record(tmp_path, gauges(300, 24), [hidden("link_expansion", 1.1)], name="other", seed=5)
    model = tmp_path / "tripod.model.yaml"
    said = run("add", "link_expansion", "--recording", recording, "--model", model)
    assert "link_expansion" in said
    found = json.loads(run("compare", other, "--model", model, "--json"))
    assert found["floor_ratio"] < 1.1
    assert found["contributions"]["link_expansion"]["without_rms_um"] > 0.3
    assert found["effects"] == ["link_expansion"]
    assert found["prediction_std_um"]["parameters"] > 0


def test_a_dry_run_shows_the_fall_and_writes_nothing(recording: Path, tmp_path: Path) -> None:
    model = tmp_path / "tripod.model.yaml"
    said = run("add", "link_expansion", "--recording", recording, "--model", model, "--dry-run")
    assert "would have added link_expansion" in said
    assert not model.exists()


def test_every_step_is_in_the_ledger_and_can_be_undone(recording: Path, tmp_path: Path) -> None:
    model = tmp_path / "tripod.model.yaml"
    run("add", "link_expansion", "--recording", recording, "--model", model)
    with_one = yaml.safe_load(model.read_text())["effects"]
    run("add", "tool_offset", "--recording", recording, "--model", model)
    run("undo", "--model", model)
    assert yaml.safe_load(model.read_text())["effects"] == with_one
    run("undo", "--model", model)
    assert yaml.safe_load(model.read_text())["effects"] == []
    with pytest.raises(StateError, match="no step to undo"):
        run("undo", "--model", model)
    page = tmp_path / "ledger.html"
    said = run("ledger", model, "--html", page)
    assert [step["kind"] for step in yaml.safe_load(model.read_text())["steps"]] == ["add", "add", "undo", "undo"]
    assert "undone" in said
    assert "The falling error" in page.read_text()


def test_the_ledger_is_in_the_unit_of_the_recordings(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    elevation_deg = np.repeat(rng.uniform(20, 80, 40), 2)
    droop_arcsec = 25 * np.cos(np.deg2rad(elevation_deg)) + rng.normal(0, 1, 80)
    columns = {"elevation_deg": elevation_deg, "model_y_arcsec": 0 * droop_arcsec, "reference_y_arcsec": droop_arcsec}
    reference = {"quantity": "tool_position", "unit": "arcsec", "sigma": 1.0}
    stars = write_external(tmp_path, columns, reference, name="stars")
    model, page = tmp_path / "pointing.yaml", tmp_path / "ledger.html"
    said = run("add", "telescope:tf", "--recording", stars, "--model", model, "--dry-run")
    assert "arcsec ->" in said
    assert not UM.search(said)
    run("add", "telescope:tf", "--recording", stars, "--model", model)
    run("undo", "--model", model)
    said = run("ledger", model, "--html", page)
    assert "residuals in arcsec" in " ".join(said.split())
    text = re.sub(r"<script>.*?</script>", "", page.read_text(encoding="utf-8"), count=1, flags=re.S)
    assert "residual, arcsec rms" in text
    notebook = read_model_file(model, "external", None)._repr_html_()
    assert "arcsec (undone)" in notebook
    for shown in (said, text, notebook):
        assert not UM.search(shown)


def test_remove_fits_the_rest_again(recording: Path, tmp_path: Path) -> None:
    model = tmp_path / "tripod.model.yaml"
    run("add", "link_expansion", "--recording", recording, "--model", model)
    alone = yaml.safe_load(model.read_text())["effects"]
    run("add", "link_zero", "--recording", recording, "--model", model)
    run("remove", "link_zero", "--recording", recording, "--model", model)
    left = yaml.safe_load(model.read_text())["effects"]
    assert left[0]["parameters"][0]["value"] == pytest.approx(alone[0]["parameters"][0]["value"], rel=1e-5)
    run("fit", "--recording", recording, "--model", model)
    with pytest.raises(StateError, match="not in the model"):
        run("remove", "backlash", "--recording", recording, "--model", model)
    with pytest.raises(StateError, match="in the model already"):
        run("add", "link_expansion", "--recording", recording, "--model", model)


def test_a_formula_of_ones_own(tmp_path: Path) -> None:
    columns = gauges(300, 25)
    written = tmp_path / "granite.yaml"
    written.write_text(
        'id: granite_swelling\nport: reference\naxis: z\nformula: "k * (humidity_pct - 50)"\n'
        'parameters: {k: {unit: um, plausible: [-1, 1], source: "my notes"}}\n'
    )
    path = record(tmp_path, columns)
    text = path.read_text().splitlines()
    names = text[0].split(",")
    z, humidity = names.index("reference_z_mm"), names.index("humidity_pct")
    for k, line in enumerate(text[1:], start=1):
        cells = line.split(",")
        cells[z] = repr(float(cells[z]) + 0.1e-3 * (float(cells[humidity]) - 50))
        text[k] = ",".join(cells)
    path.write_text("\n".join(text) + "\n")
    model = tmp_path / "m.yaml"
    run("add", written, "--recording", path, "--model", model)
    (effect,) = yaml.safe_load(model.read_text())["effects"]
    assert effect["parameters"][0]["value"] == pytest.approx(0.1, abs=0.01)
    assert json.loads(run("compare", path, "--model", model, "--json"))["floor_ratio"] < 1.1


def test_an_effect_of_a_file_of_several_is_added_with_its_whole_declaration(recording: Path, tmp_path: Path) -> None:
    effects, model = tmp_path / "mine.yaml", tmp_path / "m.yaml"
    effects.write_text(
        """\
- {id: growth, port: link, formula: "k * (temperature_link - 20) * link_mm / 1000",
   parameters: {k: {unit: ppm/K, plausible: [0, 23], source: steel}}}
- {id: shift, port: tool, formula: {x: "c", z: "-c"}, parameters: {c: {unit: um, plausible: [-9, 9], source: notes}}}
"""
    )
    run("add", "growth", "--effects", effects, "--recording", recording, "--model", model)
    run("add", f"{effects}:shift", "--recording", recording, "--model", model)
    effects.unlink()
    entries = yaml.safe_load(model.read_text())["effects"]
    assert [entry["effect"]["id"] for entry in entries] == ["growth", "shift"]
    assert entries[0]["parameters"][0]["value"] == pytest.approx(1.1, abs=0.1)
    assert "&id" not in model.read_text()
    assert "rms without shift" in run("compare", recording, "--model", model)


def test_a_failed_step_writes_nothing(recording: Path, tmp_path: Path) -> None:
    model = tmp_path / "m.yaml"
    with pytest.raises(CompdError, match="no such effect"):
        run("add", "link_expantion", "--recording", recording, "--model", model)
    with pytest.raises(RecordingError):
        run("add", "link_expansion", "--recording", tmp_path / "none.csv", "--model", model)
    assert not model.exists()
