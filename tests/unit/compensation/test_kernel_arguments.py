"""What the kernels of a cycle are given has the types for which they are compiled: they do not look themselves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numba
import numpy as np
import pytest

from compd.compensation import compensation
from compd.compensation.compensation import compensate_cmm, compensate_machine_tool
from compd.compensation.values import GaugeValues, WarmStart
from compd.model import MachineModel, machine_constants, sensitivity
from compd.model import tip_derivative as derivatives
from compd.model.effects import Effect, FittedEffect, evaluate_basis
from tests.support.effect_rows import DETAILS, HEXAPOD, LIBRARY, TRIPOD, constants_of, observe_rows, random_inputs


def in_python(effect: Effect) -> Effect:
    """The same effect as a user's own code would have it."""
    return replace(effect, basis=lambda rows, constants, memory: evaluate_basis(effect, rows, constants, memory))


EFFECTS = [LIBRARY[name] for name in ("link_expansion_lag", "backlash", "tool_offset", "friction_hysteresis")]
BESIDE_PYTHON = [*EFFECTS, in_python(LIBRARY["link_zero"])]


def carrying(model: MachineModel, effects: list[Effect]) -> MachineModel:
    fitted = tuple(
        FittedEffect(effect, np.full(len(effect.columns(model.links)), 1e-3), constants_of(effect))
        for effect in effects
    )
    return replace(model, effects=fitted, constants=machine_constants(model, DETAILS))


def spy(given: list[tuple[Any, ...]], kernel: Callable[..., Any]) -> Callable[..., Any]:
    def call(*arguments: Any) -> Any:
        given.append(arguments)
        return kernel(*arguments)

    return call


def values(model: MachineModel, lead: tuple[int, ...]) -> GaugeValues:
    """In memory as a caller may have them: read-only, column by column, every other number, of whole numbers."""
    spread = np.zeros((2 * model.links, *lead)).T[..., ::2]
    spread.flags.writeable = False
    quantities = {name: np.full(lead, 20.0) for name in model.program.quantities}
    joints = np.zeros((*lead, model.joint_weights.shape[1]), dtype=int)
    at_zero = dict.fromkeys(quantities, 20.0)
    time_s = np.arange(1.0, lead[0] + 1) if lead else 1.0
    return GaugeValues(spread, joints, np.zeros((*lead, 9)), quantities, time_s, at_zero)


@pytest.mark.parametrize("lead", [(), (3,)], ids=["one", "rows"])
@pytest.mark.parametrize("effects", [[], EFFECTS, BESIDE_PYTHON], ids=["bare", "effects", "beside Python"])
@pytest.mark.parametrize("model", [TRIPOD, HEXAPOD], ids=["tripod", "hexapod"])
def test_the_compensation_gives_its_kernel_what_it_is_compiled_for(
    monkeypatch: pytest.MonkeyPatch, model: MachineModel, effects: list[Effect], lead: tuple[int, ...]
) -> None:
    machine = carrying(model, effects)
    calls: list[tuple[Any, ...]] = []
    kernel: Any = compensation.compensate_rows
    monkeypatch.setattr(compensation, "compensate_rows", spy(calls, kernel))
    _, warm = compensate_cmm(machine, values(machine, lead), WarmStart.at_zero(machine))
    compensate_cmm(machine, values(machine, lead), warm)
    target_mm = machine.zero.contact.tip_M_mm - machine.frame.zero_origin_M_mm
    compensate_machine_tool(machine, target_mm, None, values(machine, lead), warm)
    assert len(calls) >= 3
    for arguments in calls:
        assert tuple(map(numba.typeof, arguments)) == kernel.signature


@pytest.mark.parametrize("model", [TRIPOD, HEXAPOD], ids=["tripod", "hexapod"])
def test_the_derivatives_give_their_kernel_what_it_is_compiled_for(
    monkeypatch: pytest.MonkeyPatch, model: MachineModel
) -> None:
    machine = carrying(model, EFFECTS)
    calls: list[tuple[Any, ...]] = []
    kernel: Any = derivatives.set_tip_derivatives
    monkeypatch.setattr(derivatives, "set_tip_derivatives", spy(calls, kernel))
    scale_mm, joint_mm, frame_mm, quantities, time_s, at_zero = values(machine, ())
    _, warm = compensate_cmm(machine, values(machine, ()), WarmStart.at_zero(machine))
    derivatives.tip_derivatives(
        machine,
        scale_mm=scale_mm,
        joint_mm=joint_mm,
        frame_mm=frame_mm,
        quantities=quantities,
        quantities_at_zero=at_zero,
        sigmas={},
        time_s=float(time_s),
        effects=warm.effects,
    )
    (arguments,) = calls
    assert tuple(map(numba.typeof, arguments)) == kernel.signature


@pytest.mark.parametrize("model", [TRIPOD, HEXAPOD], ids=["tripod", "hexapod"])
def test_the_sensitivities_give_their_kernel_what_it_is_compiled_for(
    monkeypatch: pytest.MonkeyPatch, model: MachineModel
) -> None:
    calls: list[tuple[Any, ...]] = []
    kernel: Any = sensitivity.set_sensitivities
    monkeypatch.setattr(sensitivity, "set_sensitivities", spy(calls, kernel))
    sensitivity.sensitivities(model, observe_rows(model, random_inputs(model)), ["scale", "reference", "plate"])
    sensitivity.sensitivities(model, observe_rows(model, random_inputs(model)), ["reference"])
    assert len(calls) == 2
    for arguments in calls:
        assert tuple(map(numba.typeof, arguments)) == kernel.signature
