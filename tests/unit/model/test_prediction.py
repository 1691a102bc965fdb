"""Predictions with something added at the ports, their derivatives, and the example recordings."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from compd.compensation import GaugeValues, WarmStart, compensate_cmm
from compd.model.deltas import deltas_by_effect, effect_deltas, sum_deltas
from compd.model.effects.effect import PORTS, FittedEffect, Port
from compd.model.effects.effect_basis import evaluate_basis, port_size
from compd.model.effects.observations import Observations
from compd.model.kernels.solve_status import Reason
from compd.model.kinematics.motion import Movement
from compd.model.kinematics.tool import ToolOnPlate
from compd.model.machine import MachineModel
from compd.model.prediction import perturb_machine, predict
from compd.model.sensitivity import link_residuals, sensitivities
from compd.rotation import compose, rotation_vector
from tests.support.effect_derivatives import effect_sensitivity
from tests.support.effect_rows import HEXAPOD, LIBRARY, TRIPOD, constants_of, observe_rows, random_inputs
from tests.support.model_machines import Floats, inverse_pose
from tests.support.paths import SHARED

RECORDINGS = SHARED / "recordings"
ON_PLATE = replace(TRIPOD, arrangement=ToolOnPlate(TRIPOD.zero.contact.tip_M_mm))
MACHINES = {"tripod": TRIPOD, "hexapod": HEXAPOD, "tool on plate": ON_PLATE}
STEP = 1e-4  # mm, or rad at the port `revolute_axis`


def changed(model: MachineModel, rows: Observations, port: Port, i: int) -> tuple[Floats, Floats, Floats]:
    """Central differences of tip, attitude and link lengths by the port's i-th number."""
    step = np.zeros((len(rows), port_size(port, rows)))
    step[:, i] = STEP
    ahead, behind = predict(model, rows, {port: step}), predict(model, rows, {port: -step})
    assert (ahead.reason == Reason.OK).all()
    turned = rotation_vector(compose(ahead.rotation_M_P, behind.rotation_M_P.transpose(0, 2, 1)))
    return (
        (ahead.tip_mm - behind.tip_mm) / (2 * STEP),
        turned / (2 * STEP),
        (ahead.link_length_mm - behind.link_length_mm) / (2 * STEP),
    )


@pytest.mark.parametrize("name", MACHINES)
@pytest.mark.parametrize("port", PORTS)
def test_derivatives_are_the_predictions_own(name: str, port: Port) -> None:
    model = MACHINES[name]
    rows = observe_rows(model, random_inputs(model, 6))
    found = sensitivities(model, rows, [port])[port]
    size = port_size(port, rows)
    assert found.tip.shape == (6, 3, size)
    assert size > 0 or (name == "hexapod" and port == "revolute_axis")
    for i in range(size):
        tip, rotation, link_length = changed(model, rows, port, i)
        np.testing.assert_allclose(found.tip[:, :, i], tip, rtol=1e-6, atol=1e-7)
        np.testing.assert_allclose(found.rotation[:, :, i], rotation, rtol=1e-6, atol=1e-8)
        np.testing.assert_allclose(found.link_length[:, :, i], link_length, atol=1e-8)


def test_nothing_added_is_the_nominal_machine() -> None:
    arguments = random_inputs(TRIPOD)
    rows = observe_rows(TRIPOD, arguments)
    values = GaugeValues(arguments["scale_mm"], arguments["joint_mm"], arguments["frame_mm"], {})
    result, _ = compensate_cmm(TRIPOD, values, WarmStart.at_zero(TRIPOD))
    np.testing.assert_allclose(predict(TRIPOD, rows, {}).tip_mm, result.tip_M_mm, atol=1e-9)
    np.testing.assert_allclose(rows.tip_M_mm, result.tip_M_mm, atol=1e-9)
    np.testing.assert_allclose(rows.link_mm, result.link_length_mm, atol=1e-12)


@pytest.mark.parametrize("id_", list(LIBRARY))
def test_an_effects_columns_are_what_its_numbers_do(id_: str) -> None:
    """G theta is the prediction's change for a small theta, whatever the ports."""
    effect = LIBRARY[id_]
    rows = observe_rows(TRIPOD, random_inputs(TRIPOD, 5))
    basis, _ = evaluate_basis(effect, rows, constants_of(effect), None)
    theta = 1e-3 * np.array([sum(one.parameter.theta_range) / 2 or one.parameter.high for one in effect.columns(3)])
    found, _ = effect_deltas(FittedEffect(effect, theta, constants_of(effect)), rows)
    moved = predict(TRIPOD, rows, found).tip_mm - predict(TRIPOD, rows, {}).tip_mm
    by = effect_sensitivity(effect, rows, basis, sensitivities(TRIPOD, rows, effect.ports))
    assert by.tip.shape == (5, 3, len(theta))
    np.testing.assert_allclose(by.tip @ theta, moved, atol=1e-3 * np.abs(moved).max() + 1e-12)
    assert np.abs(moved).max() > 0


def test_a_row_that_cannot_be_solved_says_so_and_harms_no_other() -> None:
    arguments = random_inputs(TRIPOD, 4)
    arguments["scale_mm"] = arguments["scale_mm"].copy()
    arguments["scale_mm"][1] = -470.0
    arguments["joint_mm"][2, 4] = np.nan
    rows = observe_rows(TRIPOD, arguments)
    found = predict(TRIPOD, rows, {})
    assert [Reason(int(code)) for code in found.reason] == [Reason.OK, found.reason[1], Reason.NOT_FINITE, Reason.OK]
    assert found.reason[1] != Reason.OK
    assert np.isnan(found.tip_mm[[1, 2]]).all()
    by = sensitivities(TRIPOD, rows, list(PORTS))
    assert np.isfinite(by["link"].tip[[0, 3]]).all()
    pulled = link_residuals(by["link"], np.ones((4, 3)))
    assert np.isnan(pulled[[1, 2]]).all()
    assert np.isfinite(pulled[[0, 3]]).all()


@pytest.mark.parametrize("model", [TRIPOD, HEXAPOD], ids=["tripod", "hexapod"])
def test_a_residual_pulled_back_leads_to_the_tip_again(model: MachineModel) -> None:
    rows = observe_rows(model, random_inputs(model, 8))
    link = sensitivities(model, rows, ["link"])["link"]
    errors_mm = np.random.default_rng(0).normal(0, 1e-3, (8, model.links))
    residual_mm = (link.tip @ errors_mm[:, :, None])[:, :, 0]
    pulled = link_residuals(link, residual_mm)
    np.testing.assert_allclose((link.tip @ pulled[:, :, None])[:, :, 0], residual_mm, atol=1e-12)
    if model is TRIPOD:
        np.testing.assert_allclose(pulled, errors_mm, atol=1e-12)
    else:
        assert (np.linalg.norm(pulled, axis=1) <= np.linalg.norm(errors_mm, axis=1) + 1e-15).all()


@pytest.mark.parametrize("name", MACHINES)
def test_the_altered_machine_leads_back_to_its_scales(name: str) -> None:
    """Inverse kinematics of what was predicted, with everything added, gives the readings that it came from."""
    model = MACHINES[name]
    rows = observe_rows(model, random_inputs(model, 7))
    machine_effects = [effect for effect in LIBRARY.values() if effect.live]
    fitted = [
        FittedEffect(effect, np.full(len(effect.columns(model.links)), 0.8), constants_of(effect))
        for effect in machine_effects
        if model is not HEXAPOD or "revolute_axes" not in effect.needs
    ]
    each, _ = deltas_by_effect(fitted, rows, {})
    found = sum_deltas(list(each.values()))
    shown = predict(model, rows, found)
    no_scale_mm = np.zeros_like(rows.scale_mm)
    machine = perturb_machine(model, no_scale_mm, rows.joint_mm, rows.frame_mm, found)
    places = (machine.tool_mm, shown.tip_mm) if name == "tool on plate" else (shown.tip_mm, machine.tool_mm)
    pose = inverse_pose(model, machine.mechanism, *places, shown.rotation_M_P)
    np.testing.assert_allclose(pose.link_length_mm - machine.length_mm, rows.scale_mm, atol=1e-9)
    assert np.abs(shown.tip_mm - predict(model, rows, {}).tip_mm).max() > 1e-3


def recorded(file: Path) -> tuple[Observations, Floats]:
    """An example recording of the tripod: its rows, and the reference less the nominal model, in um."""
    with file.open(encoding="utf-8") as lines:
        table = list(csv.DictReader(lines))
    data = {name: np.array([float(row[name]) for row in table]) for name in table[0]}

    def several(names: list[str], unit: float = 1.0) -> Floats:
        return unit * np.stack([data[name] for name in names], axis=1)

    scale_mm = several([f"scale_{i}_mm" for i in (1, 2, 3)])
    movement = Movement(several([f"approach_{i}" for i in (1, 2, 3)]), 0 * scale_mm, np.zeros((len(table), 9)))
    arguments: Mapping[str, Any] = {
        "scale_mm": scale_mm,
        "joint_mm": several([f"joint_{k}_um" for k in range(1, 10)], 1e-3),
        "frame_mm": several([f"frame_{d}_um" for d in ("t1", "t2", "t3", "u1", "u2", "u3", "u4", "u5", "u6")], 1e-3),
        "quantities": {k: v for k, v in data.items() if k.startswith(("temperature", "force", "pressure"))},
        "time_s": data["time_s"],
        "session_start": np.concatenate([[True], np.diff(data["session"]) != 0]),
        "movement": movement,
    }
    rows = observe_rows(TRIPOD, arguments)
    return rows, 1e3 * (several([f"reference_{axis}_mm" for axis in "xyz"]) - rows.tip_M_mm)


ANSWERED = ["example-link-expansion", "example-plate-bending", "example-elastic-and-backlash"]


@pytest.mark.parametrize("name", ANSWERED)
@pytest.mark.parametrize("part", ["train", "valid"])
def test_the_hidden_effects_come_out_with_their_numbers(name: str, part: str) -> None:
    """Plain least squares of the effects that are known to be hidden: their numbers, and nothing left but noise."""
    folder = RECORDINGS / name
    if not folder.exists():
        pytest.skip(f"no example recordings: {folder} is not there")
    answer = json.loads((folder / "answer.json").read_text())["effects"]
    rows, residual_um = recorded(folder / f"{part}.csv")
    by = sensitivities(TRIPOD, rows, list(PORTS))
    blocks = [
        effect_sensitivity(LIBRARY[id_], rows, evaluate_basis(LIBRARY[id_], rows, {}, None)[0], by).tip
        for id_ in answer
    ]
    G = 1e3 * np.concatenate(blocks, axis=2).reshape(residual_um.size, -1)
    theta, _, rank, _ = np.linalg.lstsq(G, residual_um.ravel(), rcond=None)
    left_um = residual_um.ravel() - G @ theta
    assert np.sqrt((left_um**2).mean()) < 0.165  # the reference's 0.15 and the gauges' noise
    true = np.concatenate([np.atleast_1d(value) for value in answer.values()])
    shown = [
        one.parameter.from_theta(value)[0]
        for one, value in zip([c for id_ in answer for c in LIBRARY[id_].columns(3)], theta, strict=True)
    ]
    assert rank == len(true)
    np.testing.assert_allclose(shown, true, rtol=0.04)
