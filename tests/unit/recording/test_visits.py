"""Rows are repeats where they follow each other in one session at one place, whatever their visit's number."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import compd
from compd.arrays import FloatArray
from compd.cli.app import app
from compd.recording.visits import file_numbers, pose_mm, unique_visits

SIDECAR = "format: 3\nmachine: external\nreference: {quantity: tool_position, frame: machine}\n"
NOISE_UM, GROWTH_UM_PER_K = 1.0, 4.3


def visits(number: list[int], session: list[int] | None = None, x_mm: list[float] | None = None) -> list[int]:
    place_mm = None if x_mm is None else np.array(x_mm)[:, None]
    of_session = None if session is None else np.array(session)
    found = unique_visits(np.array(number), of_session, place_mm, None)[0]
    return [int(k) for k in np.unique(found, return_inverse=True)[1]]


def test_a_number_in_another_session_is_another_visit() -> None:
    assert visits([1, 1, 2, 1, 1, 2], session=[0, 0, 0, 1, 1, 1]) == [0, 0, 1, 2, 2, 3]


def test_a_number_that_comes_back_is_another_visit() -> None:
    found = unique_visits(np.array([1, 1, 2, 1, -1, 1]), None, None, None)[0]
    assert len(set(found.tolist())) == 5
    assert file_numbers(found).tolist() == [1, 1, 2, 1, -1, 1]
    assert found[4] == -1


def test_rows_at_another_place_are_another_visit() -> None:
    assert visits([1, 1, 1, 1], x_mm=[0.0, 0.001, 40.0, 40.001]) == [0, 0, 1, 1]


def test_rows_of_a_machine_that_creeps_are_no_repeats() -> None:
    assert visits([1, 1, 1, 2, 2], x_mm=[0.0, 0.06, 0.12, 5.0, 5.01]) == [0, 2, 3, 1, 1]


def test_rows_of_reflectors_in_turn_are_repeats_of_each() -> None:
    number, target_mm = np.array([1, 2, 1, 2, 3, 4]), np.array([[0.0], [9.0]] * 3)
    found = unique_visits(number, None, np.zeros((6, 1)), target_mm)[0]
    assert found.tolist() == number.tolist()


def four_sessions(path: Path, columns: str = "session,visit", seed: int = 1) -> Path:
    """A ram that grows, 30 visits of two rows a session, in another order in each; `visit` counts from 1 in each."""
    rng = np.random.default_rng(seed)
    place_mm = rng.uniform(-100, 100, (30, 3))
    rows: list[FloatArray] = []
    for session in range(4):
        for visit, point in enumerate(rng.permutation(30)):
            for _ in range(2):
                time_s = 5.0 * len(rows) + 600 * session
                ram_degC = 20 + 4 * np.sin(time_s / 900 + session)
                seen_mm = place_mm[point] + 1e-3 * NOISE_UM * rng.standard_normal(3)
                seen_mm[2] -= 1e-3 * GROWTH_UM_PER_K * (ram_degC - 20)
                own = {"session": session + 1, "visit": visit + 1}
                rows.append(
                    np.array([time_s, *(own[c] for c in columns.split(",")), ram_degC, *place_mm[point], *seen_mm])
                )
    names = ["time_s", *columns.split(","), "temperature_ram_degC"]
    names += [f"{kind}_{axis}_mm" for kind in ("model", "reference") for axis in "xyz"]
    np.savetxt(path, rows, delimiter=",", header=",".join(names), comments="", fmt="%.9g")
    path.with_suffix(".yaml").write_text(SIDECAR, encoding="utf-8")
    return path


@pytest.mark.parametrize("columns", ["session,visit", "visit"])
def test_visit_numbers_that_begin_again_hide_nothing(columns: str, tmp_path: Path) -> None:
    path = four_sessions(tmp_path / "logged.csv", columns)
    floor = compd.compare(path).floor
    assert floor.um == pytest.approx(NOISE_UM, rel=0.15)
    effect = tmp_path / "growth.yaml"
    effect.write_text(
        'id: growth\nport: reference\naxis: z\nformula: "-k * (temperature_ram_degC - 20)"\n'
        'parameters: {k: {unit: um/K, plausible: [0, 12], source: "400 mm of steel"}}\n',
        encoding="utf-8",
    )
    diagnosis = compd.diagnose(path, effects=effect)
    assert diagnosis.verdict != "adequate"
    assert [step.effect.id for step in diagnosis.steps] == ["growth"]
    checked = CliRunner().invoke(app, ["recording", "check", str(path)])
    assert "numbers come back" in checked.output


def test_a_turn_at_the_same_place_is_another_visit() -> None:
    poses = pose_mm(np.zeros((4, 3)), np.array([[0.0, 0, 0], [1e-5, 0, 0], [0.05, 0, 0], [0.05, 0, 0]]))
    found = unique_visits(np.ones(4, dtype=np.int64), None, poses, None)[0]
    assert found[0] == found[1] != found[2] == found[3]
