"""An effect in plain Python gives what its compiled twin gives; and adopting a model compiles nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numba.core import event

from compd.compensation import GaugeValues, WarmStart, compensate_cmm, compensate_machine_tool
from compd.errors import CompdError
from compd.model.effects.effect import ConstantValues, Effect, FittedEffect, Memory
from compd.model.effects.effect_basis import evaluate_basis
from compd.model.effects.observations import Observations
from compd.model.machine import MachineModel, machine_constants
from tests.support.effect_rows import DETAILS, HEXAPOD, LIBRARY, TRIPOD, constants_of, random_inputs
from tests.support.formulas import written
from tests.support.model_machines import Floats

ROWS = 12


def in_python(effect: Effect) -> Effect:
    """The same effect as a user's own code would have it: called with rows of observations."""

    def basis(rows: Observations, constants: ConstantValues, memory: Memory) -> tuple[Floats, Memory]:
        return evaluate_basis(effect, rows, constants, memory)

    return replace(effect, basis=basis)


def carrying(model: MachineModel, *effects: Effect) -> MachineModel:
    fitted = tuple(
        FittedEffect(
            effect,
            np.array([0.1 * column.parameter.theta_range[1] for column in effect.columns(model.links)]),
            constants_of(effect),
        )
        for effect in effects
    )
    return replace(model, effects=fitted, constants=machine_constants(model, DETAILS))


def snapshots(model: MachineModel) -> list[GaugeValues]:
    arguments = random_inputs(model, ROWS)
    return [
        GaugeValues(
            arguments["scale_mm"][i],
            arguments["joint_mm"][i],
            arguments["frame_mm"][i],
            {name: values[i] for name, values in arguments["quantities"].items()},
            arguments["time_s"][i],
            arguments["quantities_at_zero"],
        )
        for i in range(ROWS)
    ]


def results(machine: MachineModel, machine_tool: bool) -> list[Floats]:
    """Setpoint, tip and shares, snapshot by snapshot."""
    warm, rows = WarmStart.at_zero(machine), []
    target_mm = machine.arrangement.measured_tip_mm(machine.zero.contact) - machine.frame.zero_origin_M_mm
    for i, values in enumerate(snapshots(machine)):
        if machine_tool:
            result, warm = compensate_machine_tool(machine, target_mm + 0.5 * i, None, values, warm)
        else:
            result, warm = compensate_cmm(machine, values, warm)
        assert not result.reason
        rows.append(np.concatenate([result.scale_setpoint_mm, result.tip_M_mm, *result.contributions.values()]))
    return rows


@pytest.mark.parametrize("machine_tool", [False, True], ids=["CMM mode", "machine-tool mode"])
@pytest.mark.parametrize("model", [TRIPOD, HEXAPOD], ids=["tripod", "hexapod"])
def test_python_effects_among_compiled_ones_give_the_same(model: MachineModel, machine_tool: bool) -> None:
    """With memory, with motion, at a port of the frame, of the mechanism and of the lengths."""
    ids = (
        "link_expansion_lag",
        "gauge_latency",
        "frame_rod_expansion",
        "friction_hysteresis",
        "tool_offset",
        "backlash",
    )
    effects = [LIBRARY[id_] for id_ in ids]
    mixed = [in_python(effect) if index % 2 == 0 else effect for index, effect in enumerate(effects)]
    compiled = results(carrying(model, *effects), machine_tool)
    np.testing.assert_allclose(results(carrying(model, *mixed), machine_tool), compiled, rtol=0, atol=1e-12)
    without = results(carrying(model), machine_tool)
    moved = [np.abs(a[: model.links] - b[: model.links]).max() for a, b in zip(compiled, without, strict=True)]
    assert min(moved) > 1e-4, "effects that move nothing test nothing"


def test_adopting_a_formula_compiles_nothing() -> None:
    effect = written("k * lag(temperature_room_degC - 20, 300) * sin(scale_mm / 3)", port="scale")
    results(carrying(TRIPOD, LIBRARY["link_zero"]), machine_tool=False)
    with event.install_recorder("numba:compile") as recorder:
        results(carrying(TRIPOD, effect), machine_tool=True)
    assert not recorder.buffer


def test_a_quantity_that_is_not_measured_is_named() -> None:
    machine = carrying(TRIPOD, LIBRARY["link_expansion"])
    values = snapshots(machine)[0]._replace(quantities={"temperature_link_1_degC": np.array(21.0)})
    with pytest.raises(CompdError, match="temperature_link_2_degC"):
        compensate_cmm(machine, values, WarmStart.at_zero(machine))
