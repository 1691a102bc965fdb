"""Gross poses are named, and no good one, also where several of them hide each other."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import compd
from compd.arrays import FloatArray
from compd.calibration import calibration_parameters
from compd.calibration.gross_poses import PoseRows, gross_poses
from compd.calibration.machine_fit import fit_machine
from compd.calibration.poses import MeasuredPoses
from compd.machine_kinds import KINDS
from tests.support.built_machines import NOISE_MM, built, drawing, record

# Of a gross pose, in standard deviations of the noise.
LEAST, MOST = 20.0, 200.0
DRAWS = 20


def linear_problem(rng: np.random.Generator, off: dict[int, float], declared: float, poses: int = 40) -> PoseRows:
    """Normal noise about 20 numbers and a constant, three coordinates a pose."""
    J, R = 10 * rng.standard_normal((poses, 3, 20)), np.tile(np.eye(3), (poses, 1, 1))
    z = J @ np.linspace(-1, 1, 20) + rng.standard_normal((poses, 3)) + 5.0
    for pose, size in off.items():
        z[pose, 1] += size
    return PoseRows(z, J, R, np.ones(poses, dtype=bool), (slice(3),), np.array([declared]))


def tolerance(_: object) -> FloatArray:
    return np.eye(20)


@pytest.mark.parametrize("declared", [1.0, np.nan], ids=["declared", "not-declared"])
def test_poses_that_hide_each_other_are_found(declared: float) -> None:
    rng = np.random.default_rng(5)
    off = {3: 20.0, 11: 21.0, 12: -900.0, 30: 24.0, 39: -20.0}
    for _ in range(20):
        (gross,) = gross_poses([linear_problem(rng, off, declared)], tolerance)
        assert set(np.flatnonzero(gross)) == set(off)


@pytest.mark.parametrize("declared", [1.0, np.nan], ids=["declared", "not-declared"])
def test_normal_noise_has_no_gross_pose(declared: float) -> None:
    rng = np.random.default_rng(6)
    assert not any(gross_poses([linear_problem(rng, {}, declared)], tolerance)[0].any() for _ in range(50))


def test_each_recording_has_its_own() -> None:
    rng = np.random.default_rng(7)
    found = gross_poses(
        [linear_problem(rng, {4: 30.0}, 1.0), linear_problem(rng, {9: 30.0, 8: -40.0}, np.nan)], tolerance
    )
    assert [np.flatnonzero(one).tolist() for one in found] == [[4], [8, 9]]


def gross_and_found(directory: Path, kind: str, poses: int, draw: int) -> tuple[set[int], set[int]]:
    """One machine, with 1 to 5 gross poses (of 30 to 3), off along an axis, in space or on one scale."""
    rng = np.random.default_rng([draw, poses, list(KINDS).index(kind)])
    world = built(drawing(kind, directory), rng)
    rows = rng.choice(poses, int(rng.integers(1, 4 if poses < 40 else 6)), replace=False)
    off_mm: dict[int, float | FloatArray] = {}
    off_scale: dict[int, tuple[int, float]] = {}
    for row in rows.tolist():
        size = float(NOISE_MM * LEAST * (MOST / LEAST) ** rng.uniform() * rng.choice([-1, 1]))
        way = int(rng.integers(3))
        if way == 0:
            off_scale[row] = (int(rng.integers(world.drawn.scales)), 2 * size)
        else:
            off_mm[row] = size if way == 1 else size * np.sign(rng.standard_normal(3))
    path = record(directory / "poses.csv", world, rng, poses, gross_mm=off_mm, gross_scale=off_scale)
    if rng.random() < 0.5:
        sidecar = path.with_suffix(".yaml")
        sidecar.write_text(re.sub(r"\n *sigma_.*", "", sidecar.read_text(encoding="utf-8")), encoding="utf-8")
    learned = compd.open_recording(path)
    parameters = calibration_parameters(learned.model, learned.rows, (), ["tool_offset"])
    fit = fit_machine([MeasuredPoses.of(learned, parameters)], parameters, np.ones(len(parameters.names), dtype=bool))
    return set(rows.tolist()), set(np.flatnonzero(fit.outlier[0]).tolist())


@pytest.mark.parametrize(("kind", "poses"), [("6-ups", 40), ("3-spr", 30), ("linear-delta", 60)])
def test_gross_poses_of_a_machine_are_named_and_no_good_one(kind: str, poses: int, tmp_path: Path) -> None:
    for draw in range(2):
        gross, found = gross_and_found(tmp_path, kind, poses, draw)
        assert found == gross


def test_errors_of_50_mm_turn_neither_the_frame_nor_the_numbers(tmp_path: Path) -> None:
    rng = np.random.default_rng(9)
    world = built(drawing("3-spr", tmp_path), rng)
    off = {7: 50.0, 11: 48.0, 13: -50.0, 14: 55.0, 34: 51.0}
    learned = compd.open_recording(record(tmp_path / "monday.csv", world, rng, 40, gross_mm=off))
    other = compd.open_recording(record(tmp_path / "other.csv", world, rng, 40, noise=0.0))
    result = compd.calibrate(learned, other)
    assert [pose.row - 2 for pose in result.gross] == list(off)
    assert result.sealed[0].after_rms_um < 0.5 * 1e3 * NOISE_MM


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_of_20_machines_of_each_kind_the_gross_poses_of_19_are_named(kind: str, tmp_path: Path) -> None:
    right = 0
    for draw in range(DRAWS):
        gross, found = gross_and_found(tmp_path, kind, (30, 40, 60)[draw % 3], draw)
        right += found == gross
    assert right >= 0.95 * DRAWS


def test_a_machine_as_drawn_in_its_own_frame_has_gross_poses_too() -> None:
    """Nothing is fitted, neither numbers nor a registration."""
    rng = np.random.default_rng(8)
    problem = linear_problem(rng, {6: 60.0}, 1.0)
    problem = problem._replace(z=rng.standard_normal((40, 3)), J=np.zeros((40, 3, 0)), R=np.zeros((40, 3, 0)))
    problem.z[6, 1] += 60.0
    (gross,) = gross_poses([problem], lambda _: np.zeros((0, 0)))
    assert np.flatnonzero(gross).tolist() == [6]
