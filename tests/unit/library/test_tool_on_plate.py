"""Effects of a tool that stands on the plate: hidden in the simulated machine and fitted; live, and in both modes."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import compd
from compd.comparison import AlignedRecording
from compd.compensation import GaugeValues, WarmStart, compensate_cmm, compensate_machine_tool
from compd.configuration import load
from compd.model import MachineModel, MachineParts, machine_constants, machine_model
from compd.model.effects import FittedEffect
from compd.model.kinematics import ToolOnPlate
from tests.support.effect_rows import DETAILS, LIBRARY, all_quantities
from tests.support.model_machines import Floats, tripod_parts
from tests.support.simulated import TRIPOD, tripod_with_tool_on_plate

Hide = Callable[[str], AlignedRecording]
TOOL_M_MM = np.array([0.0, 0.0, 190.0])
LOAD_N = np.array([10.0, -20.0, 5.0])
WARM_K = 5.0
# Each effect's numbers, and by how much they move the tool's tip in {M} under this load at this temperature, um.
CASES = {
    "tool_bending": ([0.5], -0.5 * LOAD_N),
    "tool_expansion": ([12.0], 1e-3 * 12.0 * WARM_K * TOOL_M_MM),
    "tool_offset": ([3.0, -4.0, 5.0], np.array([3.0, -4.0, 5.0])),
}


@pytest.fixture
def hide(tmp_path: Path) -> Hide:
    """Makes campaigns on the tripod with its tool on the plate and one cause hidden in it."""
    configuration = replace(load(TRIPOD), geometry=tripod_with_tool_on_plate())

    def campaign(cause: str) -> AlignedRecording:
        files = compd.simulate_campaign(configuration, tmp_path / "hidden.csv", seed=3, effects=[cause])
        return compd.open_recording(files.recording, configuration)

    return campaign


def fit(aligned: AlignedRecording, id_: str) -> list[float]:
    """The effect's numbers; with them only noise and the campaign's weak disturbances are left."""
    model = compd.add_effect(None, id_, aligned)
    comparison = compd.compare(aligned, model)
    assert comparison.rms_um < 1.15 * comparison.floor.um
    return [number.value for number in model.numbers()]


@pytest.mark.long
def test_a_hidden_compliance_is_fitted_with_its_sign(hide: Hide) -> None:
    assert fit(hide("tool_bending=0.5"), "tool_bending") == pytest.approx([0.5], rel=0.02)


@pytest.mark.long
def test_a_hidden_expansion_is_fitted_along_the_tool_on_the_plate(hide: Hide) -> None:
    """The tool is 190 mm high. The cause has 15 % of the platform's temperature, which the effect does not know."""
    assert fit(hide("tool_expansion=12"), "tool_expansion") == pytest.approx([12.0], rel=0.05)


@pytest.mark.long
def test_a_hidden_offset_is_fitted_in_the_plates_frame(hide: Hide, tmp_path: Path) -> None:
    aligned = hide("tool_offset=10")
    hidden = json.loads((tmp_path / "hidden.answer.json").read_text(encoding="utf-8"))["effects"]["tool_offset"]
    assert fit(aligned, "tool_offset") == pytest.approx(hidden, abs=0.2)


def machine_with(id_: str) -> tuple[MachineModel, Floats]:
    """The tripod with its tool on the plate and this effect, and how far that moves the tool's tip in {M}, mm."""
    theta, moved_um = CASES[id_]
    model = machine_model(MachineParts(**{**tripod_parts(), "arrangement": ToolOnPlate(TOOL_M_MM)}))
    fitted = FittedEffect(LIBRARY[id_], np.array(theta))
    return replace(model, effects=(fitted,), constants=machine_constants(model, DETAILS)), 1e-3 * moved_um


def readings(scale_mm: Floats) -> GaugeValues:
    """One snapshot under the load, with a warm tool."""
    loaded = {f"force_{axis}_N": force for axis, force in zip("xyz", LOAD_N, strict=True)}
    quantities = all_quantities(3, 1, {**loaded, "temperature_tool_degC": 20.0 + WARM_K})
    return GaugeValues(
        scale_mm,
        np.zeros(9),
        np.zeros(9),
        {name: values[0] for name, values in quantities.items()},
        time_s=0.0,
        quantities_at_zero={name: float(values[0]) for name, values in all_quantities(3, 1, {}).items()},
    )


@pytest.mark.parametrize("id_", CASES)
def test_the_running_machine_moves_the_tip_in_the_plates_frame(id_: str) -> None:
    """However the platform leans; the place on the work that is touched moves along with the tip."""
    machine, moved_mm = machine_with(id_)
    values, start = readings(np.array([40.0, -15.0, 8.0])), WarmStart.at_zero(machine)
    found, _ = compensate_cmm(machine, values, start)
    without, _ = compensate_cmm(replace(machine, effects=()), values, start)
    assert found.tip_M_mm - without.tip_M_mm == pytest.approx(moved_mm, abs=1e-9)
    assert found.tip_P_mm - without.tip_P_mm == pytest.approx(found.rotation_M_P.T @ moved_mm, abs=1e-9)


@pytest.mark.parametrize("id_", CASES)
def test_the_setpoint_brings_the_place_on_the_work_to_the_moved_tip(id_: str) -> None:
    machine, moved_mm = machine_with(id_)
    start = WarmStart.at_zero(machine)
    target_P_mm = machine.zero.contact.tip_P_mm + np.array([12.0, -7.0, 3.0])
    asked, _ = compensate_machine_tool(machine, target_P_mm, None, readings(np.full(3, np.nan)), start)
    found, _ = compensate_cmm(machine, readings(asked.scale_setpoint_mm), start)
    assert found.tip_P_mm == pytest.approx(target_P_mm, abs=1e-9)
    assert found.tip_M_mm == pytest.approx(TOOL_M_MM + moved_mm, abs=1e-9)
