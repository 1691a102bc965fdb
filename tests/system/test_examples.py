"""The examples run from the checkout as printed, write only where they are told, and what they show is true."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.paths import ROOT
from tests.support.patience import PATIENCE_S

EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
LONGEST = 80
FALL = re.compile(r"(\w+(?: \w+)?): (?P<before>[\d.]+) um -> (?P<after>[\d.]+) um, noise floor (?P<floor>[\d.]+) um")


def run(name: str, *arguments: object) -> str:
    done = subprocess.run(
        [sys.executable, ROOT / "examples" / name, *map(str, arguments)],
        cwd=ROOT, capture_output=True, text=True, check=False, timeout=PATIENCE_S,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def fall_um(said: str) -> tuple[float, float, float]:
    """Error before and after on rows that were not fitted, and the noise floor."""
    (match,) = FALL.finditer(said)
    return float(match["before"]), float(match["after"]), float(match["floor"])


@pytest.mark.long
@pytest.mark.sample
def test_the_comparators_of_the_first_recording_bring_the_error_to_the_floor(tmp_path: Path) -> None:
    said = run("first_recording.py", tmp_path)
    without = {source: float(um) for source, um in re.findall(r"without compensation of the (\w+): ([\d.]+) um", said)}
    error_um, floor_um = map(float, re.search(r"error with both: ([\d.]+) um, noise floor ([\d.]+) um", said).groups())
    assert min(without["joints"], without["frame"]) > 10 * error_um
    assert error_um < 1.15 * floor_um
    assert "nothing is missing" in said
    assert "is left out: beyond all noise" in said
    assert {path.suffix for path in tmp_path.iterdir()} == {".csv", ".yaml", ".json"}


@pytest.mark.long
@pytest.mark.sample
@pytest.mark.parametrize("number", [(), (7,)], ids=["the printed number", "another number"])
def test_a_hidden_effect_is_found_and_the_error_falls_on_other_days(number: tuple[int, ...], tmp_path: Path) -> None:
    before_um, after_um, floor_um = fall_um(run("find_missing_effect.py", tmp_path, *number))
    assert before_um > 1.5 * floor_um
    assert after_um < 1.3 * floor_um
    assert after_um < before_um / 1.5
    assert (tmp_path / "tripod.model.yaml").exists()


def test_the_script_that_finds_it_does_not_know_it() -> None:
    text = (ROOT / "examples" / "find_missing_effect.py").read_text(encoding="utf-8")
    assert "answer" not in text
    assert "expansion" not in text


def test_an_external_machine_learns_what_its_model_lacks(tmp_path: Path) -> None:
    said = run("external_machine.py", tmp_path)
    before_um, after_um, floor_um = fall_um(said)
    assert before_um > 5 * floor_um
    assert after_um < 1.15 * floor_um
    assert "temperature_spindle_degC" in said


@pytest.mark.long
def test_an_arms_wrong_length_and_zero_are_found_among_eight(tmp_path: Path) -> None:
    said = run("arm_parameters.py", tmp_path)
    before_um, after_um, floor_um = fall_um(said)
    assert before_um > 10 * floor_um
    assert after_um < 1.1 * floor_um
    found = {name: float(value) for name, value in re.findall(r"^ +(\w+) = ([-\d.]+) \+-", said, re.MULTILINE)}
    assert found == pytest.approx({"zero_3": 0.04, "forearm": 0.6}, rel=0.05)


@pytest.mark.long
def test_without_an_argument_nothing_is_left_behind(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, ROOT / "examples" / "external_machine.py"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
        timeout=PATIENCE_S,
        env={"TMPDIR": str(tmp_path), **_path()},
    )
    assert "tuesday: " in done.stdout
    assert list(tmp_path.iterdir()) == []


def _path() -> dict[str, str]:
    """Where this Python finds compd."""
    return {"PYTHONPATH": ":".join([str(ROOT), str(ROOT / "drivers")])}


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.name)
def test_examples_are_short(path: Path) -> None:
    assert len(path.read_text(encoding="utf-8").splitlines()) < LONGEST
