"""The model file: what is written is read, whole or not at all, and only for its own machine."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from compd.errors import StateError
from compd.model_file.model_document import ModelStep, read_stored
from compd.model_file.model_file import ModelFile
from compd.model_file.model_reader import read_model_file
from tests.support.measured import hidden

FORMULA = {
    "id": "granite_swelling",
    "port": "link",
    "formula": "k * (humidity_pct - 50)",
    "parameters": {"k": {"unit": "um", "plausible": [-1, 1], "source": "my notes"}},
}


def example() -> ModelFile:
    """Two effects that know of each other's errors."""
    fitted = (hidden("link_elasticity", 28.0), hidden("link_expansion_lag", 1.1, tau=1300.0))
    covariance = np.array([[1e-7, 2e-8], [2e-8, 4e-6]])
    step = ModelStep(
        "add",
        "link_elasticity",
        "2026-11-20T10:00:00+00:00",
        "run.csv",
        "0f",
        1.6,
        0.2,
        0.15,
        {"effects": [], "covariance": []},
    )
    return ModelFile("tripod-cmm", 3, ("link_elasticity", "link_expansion_lag"), fitted, covariance, (step,))


def test_what_is_written_is_read(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    example().write(path)
    found = read_model_file(path, "tripod-cmm", 3)
    assert found.declared == example().declared
    assert found.steps == example().steps
    np.testing.assert_allclose(found.fitted[0].theta, 1 / 28.0, rtol=1e-15)
    assert dict(found.fitted[1].constants) == {"tau": 1300.0}
    np.testing.assert_array_equal(found.covariance, example().covariance)
    np.testing.assert_array_equal(found.fitted[1].covariance, [[4e-6]])


def test_a_model_whose_effects_were_all_taken_out_is_read(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    ModelFile("tripod-cmm", 3).write(path)
    found = read_model_file(path, "tripod-cmm", 3)
    assert found.fitted == ()
    assert found.covariance.shape == (0, 0)


def test_a_step_names_its_unit_only_where_release_0_2_0_would_take_it_for_um(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    (step,) = example().steps
    replace(example(), steps=(step, replace(step, unit="arcsec"))).write(path)
    assert ["unit" in data for data in yaml.safe_load(path.read_text())["steps"]] == [False, True]
    assert [read.unit for read in read_stored(path).steps] == ["um", "arcsec"]


def test_people_read_values_with_errors_and_units(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    example().write(path)
    (number,) = yaml.safe_load(path.read_text())["effects"][0]["parameters"]
    assert number["unit"] == "N/um"
    assert number["value"] == pytest.approx(28.0)
    assert number["std"] == pytest.approx(np.sqrt(1e-7) * 28.0**2)


def test_an_unknown_error_stays_unknown(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    file = ModelFile("tripod-cmm", 3, ("link_expansion",), (hidden("link_expansion", 1.1),), np.full((1, 1), np.nan))
    file.write(path)
    assert np.isnan(read_model_file(path, "tripod-cmm", 3).covariance).all()


def test_a_file_from_before_a_shape_constant_means_what_it_meant(tmp_path: Path) -> None:
    """Releases up to 0.2 knew joint_contact without a preload."""
    path = tmp_path / "m.yaml"
    fitted = replace(hidden("joint_contact", 0.2), constants={"P": 2.0}, covariance=np.full((1, 1), 1e-4))
    ModelFile("tripod-cmm", 3, ("joint_contact",), (fitted,), fitted.covariance).write(path)
    assert read_model_file(path, "tripod-cmm", 3).fitted[0].constants == {"P": 2.0}
    data = yaml.safe_load(path.read_text())
    data["effects"][0]["shape"] = {}
    del data["checksum"]
    path.write_text(yaml.safe_dump(data))
    assert read_model_file(path, "tripod-cmm", 3).fitted[0].constants == {"P": 0.0}


def test_a_formula_is_kept_as_it_was_written(tmp_path: Path) -> None:
    from compd.model.effects import FittedEffect
    from compd.model.library import find_effect

    path = tmp_path / "m.yaml"
    effect = find_effect(FORMULA, "here")
    file = ModelFile("tripod-cmm", 3, (FORMULA,), (FittedEffect(effect, np.array([0.1])),), np.full((1, 1), 1e-4))
    file.write(path)
    found = read_model_file(path, "tripod-cmm", 3)
    assert found.declared == (FORMULA,)
    assert found.fitted[0].effect.equation == effect.equation


def parameter(data: dict[str, Any]) -> dict[str, Any]:
    entry: dict[str, Any] = data["effects"][0]["parameters"][0]
    return entry


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        (lambda data: data.update(machine="hexapod"), "belongs to another machine"),
        (lambda data: data.update(format=9), "was written by a later release(.|\n)*format: 1 to 3(.|\n)*next: install"),
        (lambda data: data.update(format=0), "format: "),
        (lambda data: data.update(colour="red"), "m.yaml, colour: is no key that belongs here"),
        (lambda data: data["effects"][0].update(effect="link_elastisity"), "no such effect"),
        (lambda data: data["effects"][0].update(parameters=[]), "has not the parameters of link_elasticity"),
        (lambda data: data["effects"][1].update(shape={}), "has not the shape constants"),
        (lambda data: data["effects"][1].pop("parameters"), "effects 2, parameters: is missing"),
        (lambda data: data.update(covariance=[[1.0]]), "another size"),
        (lambda data: data["effects"][0].update(effect=None), "effects 1, effect: is no text"),
        (lambda data: data["effects"][0]["parameters"][0].update(value="much"), "parameters 1, value: is no number"),
        (lambda data: parameter(data).update(unit="1/K"), "another unit(.|\n)*unit: 1/K(.|\n)*unit: N/um"),
        (lambda data: parameter(data).pop("unit"), "has no unit(.|\n)*allowed: unit: N/um"),
        (lambda data: parameter(data).update(std=-0.1), "std: is negative: a standard error is 0 or more"),
        (lambda data: parameter(data).update(std=1e-9), "standard error that is not the one of the covariance"),
        (lambda data: data["covariance"][0].__setitem__(0, -1e-7), "negative variance, -1e-07: number 1"),
        (lambda data: data["covariance"][1].__setitem__(1, 1e300), "standard error that is not the one of the cov"),
        (lambda data: data["covariance"][1].__setitem__(0, 1.0), "is not symmetric: 1 and 2e-08 at 2, 1"),
        (lambda data: data.update(covariance=[[1e-7, 1e-3], [1e-3, 4e-6]]), "has a correlation beyond 1"),
        (lambda data: data.update(fitted_range={"temperature_link_1_degC": [25, 19]}), "is no range: .lowest, highest"),
        (lambda data: data["effects"][0].update(plausible={"z": [0, 1]}), "is a range of no number of this effect"),
        (lambda data: data["steps"][0].update(kind="guess"), "steps 1, kind: is none of the choices"),
        (lambda data: data["steps"][0].update(colour="red"), "steps 1, colour: is no key that belongs here"),
        (lambda data: data["steps"][0].pop("kind"), "steps 1, kind: is missing"),
    ],
)
def test_a_wrong_file_is_refused_in_words(tmp_path: Path, edit: object, said: str) -> None:
    path = tmp_path / "m.yaml"
    example().write(path)
    data = yaml.safe_load(path.read_text())
    edit(data)  # type: ignore[operator]
    del data["checksum"]
    path.write_text(yaml.safe_dump(data))
    with pytest.raises(StateError, match=said):
        read_model_file(path, "tripod-cmm", 3)


@pytest.mark.parametrize("format_", [2, 1, None])
def test_files_of_earlier_releases_are_read_and_warned_of(tmp_path: Path, format_: int | None) -> None:
    path = tmp_path / "m.yaml"
    example().write(path)
    data = yaml.safe_load(path.read_text())
    assert data.pop("format") == 3
    del data["checksum"]
    counted = [effect.pop("counts_from") for effect in data["effects"]]
    assert set(counted) == {"machine zero"}
    path.write_text(yaml.safe_dump(data if format_ is None else {"format": format_, **data}))
    found = read_model_file(path, "tripod-cmm", 3)
    assert found.declared == example().declared
    no_checksum, no_range = found.warnings
    assert "has no checksum" in no_checksum.what
    assert "does not say in which range it was fitted" in no_range.what
    assert "temperature_link_3_degC" in no_range.value
    assert {fitted.effect.counts_from for fitted in found.fitted} == {"20 degC"}, "as they were fitted then"
    found.write(path)
    assert [effect["counts_from"] for effect in yaml.safe_load(path.read_text())["effects"]] == ["20 degC"] * 2


def test_what_a_person_means_and_where_it_was_fitted_are_kept(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    ranges = {f"temperature_link_{i}_degC": (19.2, 24.6) for i in (1, 2, 3)} | {
        f"force_{axis}_N": (-50.0, 50.0) for axis in "xyz"
    }
    meant = {"link_expansion_lag": {"a": (-5.0, 30.0)}}
    replace(example(), fitted_range=ranges, plausible=meant).write(path)
    found = read_model_file(path, "tripod-cmm", 3)
    assert (found.fitted_range, found.plausible, found.warnings) == (ranges, meant, ())
    assert [(number.plausible_low, number.plausible_high) for number in found.numbers() if number.parameter == "a"] == [
        (-5.0, 30.0)
    ]


def test_every_changed_digit_is_seen_and_no_comment(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    example().write(path)
    text = path.read_text()
    digits = [k for k, character in enumerate(text) if character.isdigit()]
    for k in digits[:: max(1, len(digits) // 40)]:
        changed = text[:k] + str((int(text[k]) + 1) % 10) + text[k + 1 :]
        if yaml.safe_load(changed) == yaml.safe_load(text):  # the 17th digit of a number
            continue
        path.write_text(changed)
        with pytest.raises(StateError):
            read_stored(path)
    path.write_text("# of the week after the move\n" + text)
    assert read_stored(path).machine == "tripod-cmm"


def test_a_changed_file_says_what_to_do(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    example().write(path)
    path.write_text(path.read_text().replace("value: 28.0", "value: 29.0"))
    with pytest.raises(StateError, match=r"its checksum does not fit(.|\n)*where the change is meant, remove the line"):
        read_stored(path)


def test_every_mistake_in_the_structure_is_in_one_message(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    example().write(path)
    data = yaml.safe_load(path.read_text())
    data["covariance"] = [[1.0, 2.0], [3.0]]
    data["effects"][0].pop("parameters")
    data["steps"][0]["rms_after_um"] = "little"
    path.write_text(yaml.safe_dump(data))
    with pytest.raises(StateError) as caught:
        read_stored(path)
    places = [problem.where.removeprefix(f"{path}, ") for problem in caught.value.problems]
    assert places == ["effects 1, parameters", "covariance", "steps 1, rms_after_um"]
    assert all(problem.next_step for problem in caught.value.problems)


def test_every_problem_is_in_one_message(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    example().write(path)
    data = yaml.safe_load(path.read_text())
    data["effects"][0]["effect"] = "nothing"
    data["effects"][1]["shape"] = {}
    del data["checksum"]
    path.write_text(yaml.safe_dump(data))
    with pytest.raises(StateError) as caught:
        read_model_file(path, "tripod-cmm", 3)
    assert len(caught.value.problems) == 2


@pytest.mark.parametrize("text", ["", "- a", "a: [", "\x00"])
def test_what_is_no_model_file_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "m.yaml"
    path.write_text(text)
    with pytest.raises(StateError):
        read_model_file(path, "tripod-cmm", 3)


def test_no_file(tmp_path: Path) -> None:
    with pytest.raises(StateError, match="cannot be read"):
        read_model_file(tmp_path / "none.yaml", "tripod-cmm", 3)


def test_a_disk_that_refuses_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "m.yaml"
    example().write(path)
    before = path.read_bytes()

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(StateError, match="No space left"):
        ModelFile("tripod-cmm", 3).write(path)
    assert path.read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == ["m.yaml"]
