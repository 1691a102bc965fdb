"""In which unit a residual is shown: numbers, sentences, tables, pictures."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from compd.comparison.comparison import Comparison
from compd.comparison.covariate import covariates
from compd.comparison.open import open_recording
from compd.comparison.recording_comparison import compare
from compd.diagnosis import diagnose
from compd.display_unit import format_error
from compd.model.library import load_library
from compd.report import write_comparison_page
from tests.support.command import run_in_process
from tests.support.external import measured_places, write_external

# Columns and keys keep their names; sha256 and scripts are no text.
UM = re.compile(r"(?<![\w.{])um(?![\w}])")


@pytest.mark.parametrize(
    ("value", "figures", "text"),
    [(0.1234, 2, "0.12 um"), (99.7, 2, "100 um"), (1234.4, 3, "1.23 mm"), (7.0, 3, "7.00 um"), (-250.0, 2, "-250 um")],
)
def test_large_numbers_have_no_powers_of_ten(value: float, figures: int, text: str) -> None:
    assert format_error(value, figures=figures) == text


def in_unit(directory: Path, unit: str, axes: str = "xy") -> Comparison:
    """The same numbers in um, with places in mm, or in arcsec, with places in thousands of arcsec."""
    twice = np.arange(120).reshape(2, 60).T.ravel()
    columns = {name: values[twice] for name, values in measured_places(axes).items()}
    columns["visit"] = np.repeat(np.arange(60.0), 2)
    columns["reference_x_mm"] = columns["reference_x_mm"] + 1e-4 * columns["model_x_mm"] + 0.002
    sigma: dict[str, object] = {"sigma_um": 0.1, "frame": "machine"}
    if unit != "um":
        places = [name for name in columns if name.startswith(("model", "reference"))]
        columns |= {name.replace("_mm", f"_{unit}"): columns.pop(name) * 1e3 for name in places}
        sigma = {"sigma": 0.1, "unit": unit}
    path = write_external(directory, columns, {"quantity": "tool_position", **sigma}, name=unit)
    return compare(open_recording(path))


def test_the_unit_changes_words_and_no_number(tmp_path: Path) -> None:
    um, arcsec = in_unit(tmp_path, "um"), in_unit(tmp_path, "arcsec")
    np.testing.assert_allclose(arcsec.residual_um, um.residual_um, atol=1e-6)
    assert um.floor.contradiction
    assert arcsec.verdict == um.verdict.replace(" um", " arcsec")
    assert arcsec.floor.how == um.floor.how.replace(" um", " arcsec")
    assert "`sigma`" in arcsec.floor.contradiction
    report = arcsec.as_json()
    assert report["unit"] == "arcsec"
    assert report["noise_floor_remark"] == arcsec.floor.contradiction
    assert um.as_json()["unit"] == "um"
    assert report.keys() == um.as_json().keys()
    assert list(arcsec.to_dataframe())[2:4] == ["residual_x_arcsec", "residual_y_arcsec"]
    assert "measured_x_arcsec" in arcsec.aligned.to_dataframe()


def test_trends_and_covariates_are_in_the_unit(tmp_path: Path) -> None:
    um, arcsec = in_unit(tmp_path, "um"), in_unit(tmp_path, "arcsec")
    assert any("+0.10 um/mm" in trend.text for trend in um.trends)
    assert any("+0.00010 arcsec/arcsec" in trend.text for trend in arcsec.trends)
    assert not any(UM.search(trend.text) for trend in arcsec.trends)
    place = next(covariate for covariate in covariates(arcsec.aligned) if covariate.name == "x")
    assert place.unit == "arcsec"
    np.testing.assert_allclose(place.values, arcsec.aligned.recording.columns["model_x_arcsec"])


def test_a_diagnosis_is_in_the_unit(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    azimuth_deg, tube_degC = np.repeat(rng.uniform(0, 360, 60), 2), np.repeat(rng.uniform(0, 20, 60), 2)
    away_arcsec = 3.0 * tube_degC + rng.normal(0, 1, 120)
    columns = {"azimuth_deg": azimuth_deg, "temperature_tube_degC": tube_degC}
    columns |= {"model_x_arcsec": 0 * away_arcsec, "reference_x_arcsec": away_arcsec}
    reference = {"quantity": "tool_position", "unit": "arcsec", "sigma": 1.0}
    path, page = write_external(tmp_path, columns, reference), tmp_path / "page.html"
    said = run_in_process("diagnose", str(path), str(path), "--html", str(page))
    assert "temperature_tube_degC" in said
    text = re.sub(r"<script>.*?</script>", "", page.read_text(encoding="utf-8"), count=1, flags=re.S)
    notebook = diagnose(open_recording(path), (), None, list(load_library().values()))._repr_html_()
    for shown in (said, text, notebook):
        assert "arcsec" in shown
        assert not UM.search(shown), shown


def test_the_page_is_in_the_unit(tmp_path: Path) -> None:
    comparison = in_unit(tmp_path, "arcsec", "xyz")
    path = tmp_path / "page.html"
    write_comparison_page(path, [comparison])
    text = re.sub(r"<script>.*?</script>", "", path.read_text(encoding="utf-8"), count=1, flags=re.S)
    assert "arcsec" in text
    assert "residual, arcsec" in text
    assert not UM.search(text)
