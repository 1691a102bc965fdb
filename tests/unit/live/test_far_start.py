"""A daemon that starts with its machine far from machine zero finds the machine's own assembly at once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from compd.compensation import GaugeValues, WarmStart, compensate_cmm, compensate_machine_tool, first_start
from compd.configuration import load
from compd.machine_builder import build_model
from compd.machine_kinds import KINDS, machine_text
from compd.model import MachineModel
from tests.unit.model.test_far_poses import Walked, walked

NOTHING = np.zeros(0)


def far(directory: Path, kind: str, turned: bool) -> tuple[MachineModel, Walked]:
    path = directory / f"{kind}.yaml"
    path.write_text(machine_text("mine", kind, KINDS[kind].usual), encoding="utf-8")
    configuration = load(path)
    model = build_model(configuration.geometry, configuration.wiring)
    return model, walked(model, turned)


@pytest.mark.parametrize("kind", KINDS)
def test_the_first_pose_is_that_of_the_scales(tmp_path: Path, kind: str) -> None:
    model, right = far(tmp_path, kind, turned=True)
    zero = WarmStart.at_zero(model)
    for k in range(60):
        values = GaugeValues(right.scale_mm[k], NOTHING, NOTHING, {})
        found, after = compensate_cmm(model, values, first_start(model, zero, values, None))
        np.testing.assert_allclose(found.tip_M_mm, right.tip_M_mm[k], rtol=0, atol=1e-6)
        # from then on each cycle starts where the last one ended
        assert first_start(model, after, values, None) is after


@pytest.mark.parametrize("kind", KINDS)
def test_the_first_target_is_reached_with_the_actuators_of_machine_zero(tmp_path: Path, kind: str) -> None:
    model, right = far(tmp_path, kind, turned=False)
    zero = WarmStart.at_zero(model)
    for k in range(60):
        values = GaugeValues(np.full(model.scales, np.nan), NOTHING, NOTHING, {})
        # {B0} is {M} here
        target_mm = tuple(right.tip_M_mm[k].tolist())
        start = first_start(model, zero, values, target_mm)
        found, _ = compensate_machine_tool(model, target_mm, None, values, start)
        np.testing.assert_allclose(found.scale_setpoint_mm, right.scale_mm[k], rtol=0, atol=1e-6)
