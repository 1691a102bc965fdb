"""Wrong data are named before the verdict, which is the same without them; so it is with any origin of time."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from compd.api.diagnosis import diagnose
from compd.comparison import open_recording
from compd.diagnosis import Diagnosis
from compd.diagnosis.words.summary_lines import summary_lines
from tests.support.external import write_external
from tests.support.paths import SHARED

CASES = SHARED / "cases"
GROWTH = """id: ram_growth
port: reference
axis: z
formula: "-k * (temperature_ram_degC - 20)"
parameters: {k: {unit: um/K, plausible: [0, 12], source: a test}}
"""
VISITS = 80
N = 3 * VISITS


def columns() -> dict[str, np.ndarray]:
    """Four sessions of twenty places, three rows each, within 1 um; the ram grows by 4 um/K along z."""
    rng = np.random.default_rng(4)
    places = np.tile(rng.uniform(-200.0, 200.0, (VISITS // 4, 3)), (4, 1)).repeat(3, axis=0)
    minute = np.tile(np.arange(N // 4), 4) / 12.0
    amplitude = np.array([6.0, 4.0, 7.0, 3.0]).repeat(N // 4)
    temperature = np.round(20.0 + amplitude * (1 - np.exp(-minute / 2.0)), 3)
    made = {
        "time_s": 5.0 * np.arange(N) + 2000.0 * np.arange(4).repeat(N // 4),
        "session": np.arange(4).repeat(N // 4).astype(float),
        "visit": np.arange(VISITS).repeat(3).astype(float),
        "temperature_ram_degC": temperature,
    }
    for k, axis in enumerate("xyz"):
        made[f"model_{axis}_mm"] = np.round(places[:, k], 6)
        error_um = rng.normal(0.0, 1.0, N) - (4.0 * (temperature - 20.0) if axis == "z" else 0.0)
        made[f"reference_{axis}_mm"] = np.round(made[f"model_{axis}_mm"] + 1e-3 * error_um, 6)
    return made


def diagnosed(directory: Path, changed: dict[str, np.ndarray]) -> Diagnosis:
    (directory / "growth.yaml").write_text(GROWTH)
    reference = {"quantity": "tool_position", "frame": "machine", "sigma_um": 1.0}
    return diagnose(write_external(directory, changed, reference), effects=directory / "growth.yaml")


def one_visit_off(made: dict[str, np.ndarray]) -> None:
    made["reference_z_mm"][90:93] += 2.0


def frozen(made: dict[str, np.ndarray]) -> None:
    for axis in "xyz":
        made[f"reference_{axis}_mm"][100:150] = made[f"reference_{axis}_mm"][100]


def zeros(made: dict[str, np.ndarray]) -> None:
    for axis in "xyz":
        made[f"reference_{axis}_mm"][[20, 21, 22, 160]] = 0.0


def wild(made: dict[str, np.ndarray]) -> None:
    made["temperature_ram_degC"][[30, 200]] = [85.0, -127.0]


def disagreeing(made: dict[str, np.ndarray]) -> None:
    made["reference_z_mm"][[31, 121]] += 0.4


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (one_visit_off, "rows 92 to 94: the 3 repeats of visit 30 agree"),
        (frozen, "rows 103 to 151: the reference holds the digits of row 102"),
        (zeros, "rows 22 to 24 and 162: the reference is 0 on all axes"),
        (wild, "temperature_ram_degC is "),
        (disagreeing, "rows 33 and 123: up to 40"),
    ],
)
def test_wrong_data_are_named_and_the_verdict_stays(
    tmp_path: Path, change: Callable[[dict[str, np.ndarray]], None], words: str
) -> None:
    changed = columns()
    change(changed)
    found = diagnosed(tmp_path, changed)
    assert found.verdict == "identified"
    (step,) = found.steps
    assert step.effect.id == "ram_growth"
    assert step.parameters[0].value == pytest.approx(4.0, abs=0.15)
    assert any(words in text for text in found.as_json()["data_faults"])
    lines = summary_lines(found)
    assert any(line.startswith("Data:") for line in lines)
    assert not any(line.startswith("Gross:") for line in lines)


@pytest.mark.parametrize(
    ("factor", "words"),
    [(-1.0, "the sign of reference_y_mm seems reversed"), (1000.0, "reference_y_mm seems to be in um")],
)
def test_a_column_that_seems_wrong_is_in_the_headline(tmp_path: Path, factor: float, words: str) -> None:
    changed = columns()
    changed["reference_y_mm"] *= factor
    lines = summary_lines(diagnosed(tmp_path, changed))
    assert words in lines[0]
    assert any(line.startswith("Next:    mend the column first") for line in lines)


def test_the_origin_of_time_changes_nothing(tmp_path: Path) -> None:
    def drifting(origin_s: float) -> Diagnosis:
        made = columns()
        made["reference_z_mm"] = made["model_z_mm"] + 1e-3 * np.random.default_rng(7).normal(0.0, 1.0, N)
        made["reference_z_mm"] = np.round(made["reference_z_mm"] + 4e-3 * made["time_s"] / 3600.0, 6)
        made["time_s"] = made["time_s"] + origin_s
        return diagnosed(tmp_path, made)

    first, *others = (drifting(origin_s) for origin_s in (0.0, 1_730_000_000.0, -86_400.0))
    assert [step.effect.id for step in first.steps] == ["reference_drift"]
    for other in others:
        assert (other.verdict, other.summary) == (first.verdict, first.summary)
        for mine, its in zip(first.steps[0].parameters, other.steps[0].parameters, strict=True):
            assert (its.value, its.std) == (pytest.approx(mine.value, abs=1e-4), pytest.approx(mine.std, rel=1e-4))


@pytest.mark.parametrize(
    ("recording", "effects", "words"),
    [
        ("04-one-visit-5-mm-wrong/monday.csv", "ram_growth.yaml", "rows 77 to 79"),
        ("05-frozen-reference/tracker_froze.csv", "ram_growth.yaml", "rows 102 to 141"),
    ],
)
def test_the_cases(recording: str, effects: str, words: str) -> None:
    path = CASES / recording
    if not path.exists():
        pytest.skip(f"no case: {path} is not there")
    found = diagnose(open_recording(path), effects=path.parent / effects)
    assert (found.verdict, [step.effect.id for step in found.steps]) == ("identified", ["ram_growth"])
    assert found.as_json()["data_faults"][0].startswith(words)


def test_the_case_of_unix_time() -> None:
    paths = [CASES / "02-unix-time-hides-drift" / name for name in ("from_zero.csv", "unix_time.csv")]
    if not all(path.exists() for path in paths):
        pytest.skip(f"no case: {paths[0]} is not there")
    first, second = (diagnose(path) for path in paths)
    assert [step.effect.id for step in second.steps] == ["reference_drift"]
    assert (first.verdict, first.summary) == (second.verdict, second.summary)
