"""Poses for a calibration: reachable, and together more telling than others, on machines of every kind."""

from __future__ import annotations

import csv
import io
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

import compd
from compd.calibration import Noise, PoseStudy, reachable
from compd.calibration.pose_design import Information, exchange, observability
from compd.cli.app import app
from compd.configuration import load
from compd.errors import CompdError
from compd.machine_builder import build_model
from compd.machine_kinds import KINDS, machine_text
from compd.model import MachineModel
from compd.plan_file import TIP_COLUMNS, TURN_COLUMNS
from compd.simulation import Mechanism
from compd.simulation.campaign.plan_reader import read_plan

Floats = NDArray[np.float64]


def written(tmp_path: Path, kind: str) -> Path:
    path = tmp_path / f"{kind}.yaml"
    path.write_text(machine_text("mine", kind, KINDS[kind].usual), encoding="utf-8")
    return path


def model_of(path: Path) -> MachineModel:
    configuration = load(path)
    return build_model(configuration.geometry, configuration.wiring)


@pytest.mark.parametrize("kind", KINDS)
def test_planned_poses_tell_more_than_others_of_the_same_workspace(tmp_path: Path, kind: str) -> None:
    study = PoseStudy(model_of(written(tmp_path, kind)), "pose", Noise(5.0, 5.0))
    plan = study.plan(20)
    rng = np.random.default_rng(2)
    others = [study.candidates.select(rng.choice(len(study.candidates.turn_rad), 20, replace=False)) for _ in range(8)]
    assert plan.tip_std_um < 0.8 * min(study.tip_std_um(other) for other in others)
    assert plan.tip_std_um < 0.2 * plan.tip_prior_um
    assert max(study.observability(other).O1 for other in others) <= plan.observability.O1


@pytest.mark.parametrize("kind", KINDS)
def test_the_simulated_machine_reaches_the_planned_poses(tmp_path: Path, kind: str) -> None:
    """By kinematics of its own: the plan's places and turns are what the rows of the study stand for."""
    path = written(tmp_path, kind)
    model, out = model_of(path), tmp_path / "plan.csv"
    study = PoseStudy(model, "position", Noise(5.0))
    study.plan(10).write(out)
    mechanism = Mechanism(load(path).geometry)
    rows = read_plan(out, mechanism)
    planned = study.planned(10)
    for k, row in enumerate(rows):
        # the file has three decimals of a millimetre and six of a turn
        assert row.scale_mm == pytest.approx(planned.rows.scale_mm[k], abs=0.02)


def test_fewer_poses_than_a_calibration_needs_are_refused(tmp_path: Path) -> None:
    with pytest.raises(CompdError, match=r"(?s)fewer poses than a calibration needs.*2 poses.*10 or more"):
        compd.plan_calibration(written(tmp_path, "linear-delta"), 2, noise_um=5.0)


def test_exchange_comes_near_the_best_of_all_sets() -> None:
    """By trying every set of four of twelve poses; an exchange may end at a set that no exchange improves."""
    rng = np.random.default_rng(7)
    gaps = []
    for _ in range(8):
        information = Information(rng.normal(0, 3, (12, 2, 4)), rng.normal(0, 1, (12, 2, 1)))
        found = criterion(information, exchange(information, 4))
        best = max(criterion(information, np.array(choice)) for choice in combinations(range(12), 4))
        gaps.append(best - found)
    assert min(gaps) > -1e-4
    # a share of 5 % of the standard error of each of the four numbers
    assert max(gaps) < 8 * np.log(1.05)
    assert np.median(gaps) < 1e-4


def criterion(information: Information, chosen: NDArray[np.int64]) -> float:
    """log det of the machine's information, by the Schur complement of the registration's."""
    J = information.machine[chosen].reshape(-1, 4)
    R = information.registration[chosen].reshape(-1, 1)
    M = np.eye(4) + J.T @ J - J.T @ R @ np.linalg.inv(R.T @ R + 1e-6) @ R.T @ J
    return float(np.linalg.slogdet(M)[1])


def test_poses_that_were_measured_count() -> None:
    rng = np.random.default_rng(8)
    information = Information(rng.normal(0, 3, (30, 2, 3)), np.zeros((30, 2, 0)))
    one = Information(np.array([[[100.0, 0, 0], [0, 100.0, 0]]]), np.zeros((1, 2, 0)))
    # what was measured knows two numbers: the pose that moves the third most is wanted
    chosen = exchange(information, 1, one)
    left = (information.machine[:, :, 2] ** 2).sum(axis=1)
    assert left[chosen[0]] > np.quantile(left, 0.9)


def test_indices_by_hand() -> None:
    J = np.diag([4.0, 2.0, 1.0])
    o = observability(J, np.eye(3), 4)
    assert pytest.approx(8 ** (1 / 3) / 2) == o.O1
    assert o[1:5] == pytest.approx((0.25, 1.0, 0.25, 1 / (0.25 + 0.5 + 1.0)))
    # a combination that these poses do not move
    assert observability(J[:2], np.eye(3), 2)[:5] == (0.0,) * 5
    assert observability(J[:2], np.eye(3), 2).told == 2


def test_poses_keep_away_from_singularities(tmp_path: Path) -> None:
    model = model_of(written(tmp_path, "6-ups"))
    poses = np.tile([*model.zero.contact.tip_M_mm, 0.0, 0.0, 0.0], (3, 1))
    # turned about z, the six legs of this machine lie in a linear complex near a right angle
    poses[1, 5], poses[2, 5] = np.deg2rad(10), np.deg2rad(85)
    assert len(reachable(model, poses).turn_rad) == 2
    with pytest.raises(CompdError, match="no pose within these limits can be reached"):
        reachable(model, poses[2:])


def test_on_the_command_line_in_every_format(tmp_path: Path) -> None:
    machine = written(tmp_path, "6-ups")
    arguments = ["plan", "--calibrate", "10", "--machine", str(machine), "--noise", "5"]
    texts = {}
    for shape, options in {"plan": (), "sa": (), "csv": (), "gcode": ("--feed", "900")}.items():
        out = tmp_path / f"next.{shape}"
        done = CliRunner().invoke(app, [*arguments, "--as", shape, "--out", str(out), *options])
        assert done.exit_code == 0, done.output
        assert "Observability: O1" in done.output
        texts[shape] = out.read_text(encoding="utf-8")
    row = next(csv.DictReader(io.StringIO(texts["plan"])))
    assert len(texts["sa"].splitlines()) > 5
    assert "turn_x_rad" in texts["csv"].splitlines()[0]
    move = next(line for line in texts["gcode"].splitlines() if line.startswith("G1"))
    words = {word[0]: float(word[1:]) for word in move.split()[1:]}
    assert [words[axis] for axis in "XYZ"] == pytest.approx([float(row[name]) for name in TIP_COLUMNS], abs=1e-3)
    # A about x, then B about y, then C about z, of fixed axes
    turn = Rotation.from_euler("xyz", [words[axis] for axis in "ABC"], degrees=True)
    assert turn.as_rotvec() == pytest.approx([float(row[name]) for name in TURN_COLUMNS], abs=2e-6)
    assert CliRunner().invoke(app, ["plan", "--calibrate", "10", "--machine", str(machine)]).exit_code == 2
    assert CliRunner().invoke(app, ["plan", "--rivals", "a,b"]).exit_code == 2
