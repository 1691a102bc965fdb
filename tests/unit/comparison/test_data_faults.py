"""Rows and columns that are surely wrong, or look so, are named beside what a comparison says, and do not count."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from compd.comparison import Comparison, compare, open_recording
from compd.errors import CompdError
from compd.model.formula import formula_effect
from compd.model_changes import add_to_model
from compd.model_file import ModelFile
from tests.support.external import write_external

VISITS = 40
N = 3 * VISITS


def columns(seed: int = 4) -> dict[str, np.ndarray]:
    """Twenty places, twice each, three rows at each visit, within 1 um; a temperature that moves z by 4 um/K."""
    rng = np.random.default_rng(seed)
    places = np.tile(rng.uniform(-200.0, 200.0, (VISITS // 2, 3)), (2, 1)).repeat(3, axis=0)
    temperature = np.round(20.0 + 5.0 * np.sin(np.arange(N) / 25.0), 3)
    made = {"visit": np.arange(VISITS).repeat(3).astype(float), "temperature_ram_degC": temperature}
    for k, axis in enumerate("xyz"):
        made[f"model_{axis}_mm"] = np.round(places[:, k], 6)
        error_um = rng.normal(0.0, 1.0, N) - (4.0 * (temperature - 20.0) if axis == "z" else 0.0)
        made[f"reference_{axis}_mm"] = np.round(made[f"model_{axis}_mm"] + 1e-3 * error_um, 6)
    return made


def comparison(directory: Path, changed: dict[str, np.ndarray], **more: object) -> Comparison:
    reference = {"quantity": "tool_position", "frame": "machine", "sigma_um": 1.0} | more
    return compare(open_recording(write_external(directory, changed, reference)))


def texts(found: Comparison) -> list[str]:
    return [fault.text for fault in found.faults]


def test_good_data_have_no_fault(tmp_path: Path) -> None:
    assert texts(comparison(tmp_path, columns())) == []


@pytest.mark.parametrize("off_mm", [5.0, -0.6])
def test_a_visit_whose_repeats_agree_far_from_all_else_does_not_count(tmp_path: Path, off_mm: float) -> None:
    changed = columns()
    changed["reference_z_mm"][30:33] += off_mm
    found = comparison(tmp_path, changed)
    (text,) = texts(found)
    assert text.startswith("rows 32 to 34: the 3 repeats of visit 10 agree and lie ")
    assert np.flatnonzero(~found.used).tolist() == [30, 31, 32]


def test_visits_are_told_together(tmp_path: Path) -> None:
    changed = columns()
    changed["reference_z_mm"][30:33] += 5.0
    changed["reference_x_mm"][60:63] -= 2.0
    (text,) = texts(comparison(tmp_path, changed))
    assert text.startswith("rows 32 to 34 and 62 to 64: 2 visits, of which the repeats agree, lie up to ")


def test_a_visit_under_a_load_that_no_other_has_is_to_be_explained(tmp_path: Path) -> None:
    changed = columns()
    changed["force_z_N"] = np.zeros(N)
    changed["force_z_N"][30:33] = 80.0
    changed["reference_z_mm"][30:33] += 0.6
    assert comparison(tmp_path, changed).used.all()


def test_one_visit_in_five_is_no_mistake(tmp_path: Path) -> None:
    changed = columns()
    changed["reference_z_mm"][np.isin(changed["visit"], range(0, VISITS, 5))] += 5.0
    assert comparison(tmp_path, changed).used.all()


def test_a_repeat_that_disagrees_is_told_beside_its_visit(tmp_path: Path) -> None:
    changed = columns()
    changed["reference_y_mm"][61] += 0.3
    found = comparison(tmp_path, changed)
    (text,) = texts(found)
    assert text.startswith("row 63: up to 298 um from other repeats of the same visit")
    assert np.flatnonzero(found.outlier).tolist() == [61]


def test_repeats_that_differ_within_a_large_error_are_asked_about(tmp_path: Path) -> None:
    changed = columns()
    changed["reference_z_mm"] += 1e-3 * changed["model_x_mm"]  # an error of 200 um, of which 60 is not far off
    changed["reference_z_mm"][61] += 0.06
    found = comparison(tmp_path, changed)
    (text,) = texts(found)
    assert text.startswith("rows 62 to 64: the repeats of visit 20 differ by ")
    assert found.used.all()


def test_a_wild_temperature_is_an_empty_cell_of_a_row_that_counts(tmp_path: Path) -> None:
    changed = columns()
    changed["temperature_ram_degC"][50] = 85.0
    found = comparison(tmp_path, changed)
    (text,) = texts(found)
    assert text.startswith("row 52: temperature_ram_degC is 85, where all others are ")
    assert np.isnan(found.aligned.rows.quantity("temperature_ram_degC")[50])
    assert found.used.all()


def test_rows_that_are_left_out_by_a_person_are_not_told(tmp_path: Path) -> None:
    changed = columns()
    changed["reference_z_mm"][30:33] += 5.0
    path = write_external(tmp_path, changed, {"quantity": "tool_position", "frame": "machine", "sigma_um": 1.0})
    with path.with_suffix(".yaml").open("a") as sidecar:
        sidecar.write("excluded_rows:\n- {rows: 32-34, reason: a chip}\n")
    assert texts(compare(open_recording(path))) == []


@pytest.mark.parametrize(
    ("column", "factor", "words"),
    [
        ("reference_y_mm", -1.0, "the sign of reference_y_mm seems reversed: its slope against model_y_mm is -1"),
        ("model_x_mm", -1.0, "the sign of reference_x_mm seems reversed"),
        ("reference_x_mm", 1000.0, "reference_x_mm seems to be in um"),
        ("reference_z_mm", 0.001, "reference_z_mm seems to be in m"),
        ("reference_z_mm", 1 / 25.4, "reference_z_mm seems to be in inch"),
        ("model_z_mm", 1 / 25.4, "model_z_mm seems to be in inch"),
    ],
)
def test_a_sign_and_a_unit_are_told_by_the_slope(tmp_path: Path, column: str, factor: float, words: str) -> None:
    changed = columns()
    changed[column] = np.round(changed[column] * factor, 6)
    assert any(words in text for text in texts(comparison(tmp_path, changed)))


def test_in_an_instruments_frame_a_mirror_image_is_told(tmp_path: Path) -> None:
    changed = columns()
    assert texts(comparison(tmp_path, changed, frame="instrument")) == []
    turned = {"reference_x_mm": changed["reference_y_mm"], "reference_y_mm": -changed["reference_x_mm"]}
    assert texts(comparison(tmp_path, changed | turned, frame="instrument")) == []
    turned["reference_y_mm"] = changed["reference_x_mm"]
    (text,) = texts(comparison(tmp_path, changed | turned, frame="instrument"))
    assert text.startswith("the sign of one axis of the reference, or of all three, seems reversed")


def formula(text: str, *names: str):
    parameters = {name: {"unit": "um/K", "plausible": [-12, 12], "source": "a test"} for name in names}
    return formula_effect(
        {"id": "growth", "port": "reference", "axis": "z", "formula": text, "parameters": parameters}, "test"
    )


def test_numbers_that_move_the_rows_alike_are_told_and_not_written(tmp_path: Path) -> None:
    aligned = comparison(tmp_path, columns()).aligned
    effect = formula("a * (temperature_ram_degC - 20) + b * (temperature_ram_degC - 20)", "a", "b")
    with pytest.raises(CompdError, match=r"a and b cannot be determined") as refused:
        add_to_model(ModelFile("external", 0), dict(effect.declared), effect, aligned)
    assert "growth.a and growth.b move the rows alike" in str(refused.value)


def test_a_number_that_no_row_shows_is_as_uncertain_as_its_range_is_wide(tmp_path: Path) -> None:
    aligned = comparison(tmp_path, columns()).aligned
    effect = formula("a * (temperature_ram_degC - 20) + b * 0 * temperature_ram_degC", "a", "b")
    changed = add_to_model(ModelFile("external", 0), dict(effect.declared), effect, aligned)
    growth, other = changed.numbers()
    assert growth.value == pytest.approx(-4.0, abs=0.1)
    assert (other.value, other.standard_error) == (0.0, pytest.approx(24 / 12**0.5))
    assert np.isfinite(changed.covariance).all()
    assert [remark.what for remark in changed.warnings] == ["b: no row shows this"]


def test_rows_that_a_person_vouches_for_count(tmp_path: Path) -> None:
    changed = columns()
    for axis in "xyz":
        changed[f"reference_{axis}_mm"][30:40] = changed[f"reference_{axis}_mm"][30]
    path = write_external(tmp_path, changed, {"quantity": "tool_position", "frame": "machine", "sigma_um": 1.0})
    with path.with_suffix(".yaml").open("a") as sidecar:
        sidecar.write("trusted_rows:\n- {rows: 33-38, reason: it was so}\n")
    aligned = open_recording(path)
    assert aligned.recording.row[~aligned.usable.mask].tolist() == [39, 40, 41]
    assert aligned.recording.faults[0].rows == (39, 40, 41)
