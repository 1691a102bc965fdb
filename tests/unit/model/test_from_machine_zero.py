"""Effects count from the quantities at machine zero: they add nothing there, wherever it was taken."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pytest

from compd.compensation import GaugeValues, WarmStart, compensate_cmm, compensate_machine_tool
from compd.errors import CompdError
from compd.model.deltas import effect_deltas
from compd.model.effects.effect import ConstantValues, Effect, FittedEffect, Memory, memoryless_basis
from compd.model.effects.effect_basis import evaluate_basis, recounted
from compd.model.effects.effect_needs import is_measured, unmet_needs
from compd.model.effects.observations import Observations
from compd.model.library import BUNDLED
from compd.model.machine import MachineModel, machine_constants
from tests.support.effect_rows import (
    DETAILS,
    HEXAPOD,
    LIBRARY,
    TRIPOD,
    all_quantities,
    constants_of,
    row_at_zero,
    rows_at_tips,
)
from tests.support.formulas import written
from tests.support.model_machines import Floats, tips

MACHINES = pytest.mark.parametrize("model", [TRIPOD, HEXAPOD], ids=["tripod", "hexapod"])
MEASURED = [effect for effect in BUNDLED if is_measured(effect)]
FORMULAS = [
    written("k * link_mm * temperature_link"),
    written("k * (temperature_link - 20) ** 2"),
    written("k * pressure_hPa * humidity_pct"),
    written("k * exp(-300 / (273.15 + temperature_link))"),
    written("k * lag(temperature_link, 60) * link_mm"),
    written("k * lag(scale_mm * temperature_platform_degC, 60)"),
    written("k * axial_force_N"),
    written("k * force_x_N * temperature_tool_degC", "tool", axis="x"),
]


MIXED = written("k * scale_mm + c * temperature_platform_degC * scale_mm + d", parameters="k c d")


def _with_root(rows: Observations, constants: ConstantValues) -> Floats:
    """An effect of a person's own that reads a temperature as it is shown."""
    return np.sqrt(rows.quantity("temperature_platform_degC"))[:, None, None] * np.ones((1, rows.links, 1))


PYTHON = replace(
    LIBRARY["link_expansion"],
    id="mine",
    needs=("temperature_platform_degC",),
    basis=memoryless_basis(_with_root),
)


def zero_conditions(model: MachineModel, degC: float) -> dict[str, float]:
    """Every quantity when machine zero is taken at this temperature: the parts differ a little, a load hangs on it."""
    rng = np.random.default_rng(5)
    names = all_quantities(model.links, 1, {})
    conditions = {name: degC + rng.normal(0, 0.3) for name in names if name.startswith("temperature")}
    load = {"force_x_N": 3.0, "force_y_N": -2.0, "force_z_N": -11.0}
    return conditions | load | {"pressure_hPa": 987.0, "humidity_pct": 35.0}


def rows_from(model: MachineModel, at_zero: Mapping[str, float], rows: Observations) -> Observations:
    return replace(rows, quantities_at_zero=at_zero)


@MACHINES
@pytest.mark.parametrize("degC", [15.0, 20.0, 23.0, 27.0])
@pytest.mark.parametrize(
    "effect", [*MEASURED, *FORMULAS, PYTHON], ids=lambda effect: f"{effect.id} {effect.equation}".split(" =")[0]
)
def test_nothing_is_added_while_all_is_as_at_machine_zero(model: MachineModel, effect: Effect, degC: float) -> None:
    at_zero = zero_conditions(model, degC)
    rows = row_at_zero(model, at_zero, quantities_at_zero=at_zero)
    basis, memory = evaluate_basis(effect, rows, constants_of(effect), None)
    assert np.abs(basis).max() < 1e-15
    later = replace(rows, time_s=rows.time_s + 900.0, session_start=np.array([False]))
    basis, _ = evaluate_basis(effect, later, constants_of(effect), memory)
    assert np.abs(basis).max() < 1e-15
    warmer = {name: value + 1.0 for name, value in rows.quantities.items()}
    basis, _ = evaluate_basis(effect, replace(later, quantities=warmer), constants_of(effect), memory)
    # top and bottom of the plate are warmer alike; and at zero no scale has moved
    if effect.id != "plate_bending" and "scale_mm" not in effect.equation:
        assert np.abs(basis).max() > 1e-12


@MACHINES
def test_a_link_grows_with_its_length_there_by_what_it_is_warmer_than_at_zero(model: MachineModel) -> None:
    """Away from zero, too: 1 ppm/K of the present length and of the warming since then, in both ways to write it."""
    at_zero = zero_conditions(model, 23.0)
    warming_K = 1.5
    values = {name: value + warming_K for name, value in at_zero.items() if name.startswith("temperature_link")}
    rows = rows_at_tips(model, tips(model, 6, 2, 60.0), {**at_zero, **values}, quantities_at_zero=at_zero)
    grown_mm = 1e-6 * rows.link_mm * warming_K
    for effect in (LIBRARY["link_expansion"], LIBRARY["link_expansion_lag"]):
        basis, _ = evaluate_basis(effect, rows, constants_of(effect), None)
        assert basis[:, :, 0] == pytest.approx(grown_mm, rel=1e-12)
    own = written("k * link_mm * (temperature_link - 20) / 1000")
    assert evaluate_basis(own, rows, {}, None)[0][:, :, 0] == pytest.approx(grown_mm, rel=1e-12)


def test_a_term_without_a_measured_quantity_stays_as_it_is() -> None:
    at_zero = zero_conditions(TRIPOD, 23.0)
    rows = rows_at_tips(
        TRIPOD,
        tips(TRIPOD, 4, 2, 60.0),
        {**at_zero, "temperature_platform_degC": at_zero["temperature_platform_degC"] + 2},
        quantities_at_zero=at_zero,
    )
    basis, _ = evaluate_basis(MIXED, rows, {}, None)
    assert basis[:, :, 0] == pytest.approx(1e-3 * rows.scale_mm)
    assert basis[:, :, 1] == pytest.approx(2e-3 * rows.scale_mm)
    assert basis[:, :, 2] == pytest.approx(1e-3)


def _ones(rows: Observations) -> Floats:
    return np.ones((len(rows), rows.links))


TWINS: list[tuple[Effect, Callable[[Observations], list[Floats]]]] = [
    (
        written("k * link_mm * temperature_platform_degC"),
        lambda rows: [rows.link_mm * rows.quantity("temperature_platform_degC")[:, None]],
    ),
    (
        written("k * exp(temperature_platform_degC / 10) * scale_mm"),
        lambda rows: [np.exp(rows.quantity("temperature_platform_degC") / 10)[:, None] * rows.scale_mm],
    ),
    (written("k * axial_force_N"), lambda rows: [rows.axial_force_N]),
    (
        MIXED,
        lambda rows: [
            rows.scale_mm,
            rows.quantity("temperature_platform_degC")[:, None] * rows.scale_mm,
            _ones(rows),
        ],
    ),
]


@MACHINES
@pytest.mark.parametrize("warmer_K", [0.0, 2.0])
@pytest.mark.parametrize("twins", TWINS, ids=lambda twins: twins[0].equation)
def test_an_effect_in_python_counts_as_a_formula_does(
    model: MachineModel, twins: tuple[Effect, Callable[[Observations], list[Floats]]], warmer_K: float
) -> None:
    """Away from machine zero, too; and a column that no quantity changes stays, as a formula's term does."""
    formula, columns = twins
    own = replace(formula, basis=memoryless_basis(lambda rows, _: 1e-3 * np.stack(columns(rows), axis=2)))
    at_zero = zero_conditions(model, 23.0)
    values = {name: value + warmer_K for name, value in at_zero.items()}
    rows = rows_at_tips(model, tips(model, 6, 2, 60.0), values, quantities_at_zero=at_zero)
    expected, _ = evaluate_basis(formula, rows, {}, None)
    assert np.abs(expected).max() > 1e-6 or not warmer_K
    found, _ = evaluate_basis(own, rows, {}, None)
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-12)
    each = [evaluate_basis(own, rows.select(slice(i, i + 1)), {}, None)[0] for i in range(len(rows))]
    assert (np.concatenate(each) == found).all(), "the live loop computes row by row"


def test_a_number_that_an_effect_in_python_looks_up_counts_from_that_at_zero() -> None:
    """No other number than those of the table can be tried."""
    table = np.array([5.0, 1.0, 2.0, 7.0])

    def basis(rows: Observations, constants: ConstantValues) -> Floats:
        shown: Floats = table[rows.quantity("gear").astype(int)][:, None, None] * _ones(rows)[:, :, None]
        return shown

    effect = replace(PYTHON, needs=("gear",), basis=memoryless_basis(basis))
    for at_zero in (0.0, 3.0):
        values = {"gear": np.array([0.0, 1.0, 2.0, 3.0])}
        rows = rows_at_tips(TRIPOD, tips(TRIPOD, 4, 2, 60.0), values, quantities_at_zero={"gear": at_zero})
        found, _ = evaluate_basis(effect, rows, {}, None)
        assert found[:, 0, 0] == pytest.approx(table - table[int(at_zero)])


def test_what_an_effect_in_python_remembers_counts_from_zero_too() -> None:
    """A lag, in one column of what a quantity is part of, in the other of the pose alone: in one go and row by row."""

    def basis(rows: Observations, constants: ConstantValues, memory: Memory) -> tuple[Floats, Memory]:
        inputs = np.stack([rows.link_mm * rows.quantity("temperature_platform_degC")[:, None], rows.link_mm], axis=2)
        shown, out = None if memory is None else memory[0], np.empty_like(inputs)
        for i, value in enumerate(inputs):
            shown = value.copy() if shown is None or rows.session_start[i] else shown + 0.3 * (value - shown)
            out[i] = shown
        return out, None if shown is None else (shown,)

    effect = replace(PYTHON, remembers=True, parameters=LIBRARY["backlash"].parameters[:1] * 2, basis=basis)
    at_zero = zero_conditions(TRIPOD, 23.0)
    walk = at_zero["temperature_platform_degC"] + np.array([0.0, 0.0, 0.0, 1.0, 2.0, 2.0])
    conditions = {**at_zero, "temperature_platform_degC": walk}
    rows = rows_at_tips(TRIPOD, tips(TRIPOD, 6, 2, 60.0), conditions, quantities_at_zero=at_zero)
    found, _ = evaluate_basis(effect, rows, {}, None)
    assert found[:3, :, 0] == pytest.approx(0.0, abs=1e-9), "the pose changes, the quantity does not"
    assert found[3, :, 0] == pytest.approx(0.3 * rows.link_mm[3])
    assert found[0, :, 1] == pytest.approx(rows.link_mm[0])
    memory: Memory = None
    for i in range(len(rows)):
        value, memory = evaluate_basis(effect, rows.select(slice(i, i + 1)), {}, memory)
        assert value[0] == pytest.approx(found[i], abs=1e-9)


def test_a_formula_of_a_force_in_the_links_is_the_librarys_spring() -> None:
    at_zero = zero_conditions(TRIPOD, 20.0)
    rows = rows_at_tips(TRIPOD, tips(TRIPOD, 5, 2, 60.0), {**at_zero, "force_z_N": -80.0}, quantities_at_zero=at_zero)
    own, _ = evaluate_basis(written("k * axial_force_N"), rows, {}, None)
    spring, _ = evaluate_basis(LIBRARY["link_elasticity"], rows, {}, None)
    assert own == pytest.approx(spring, rel=1e-12)


def test_a_scale_is_true_at_20_degC_and_an_interferometers_tables_too() -> None:
    """What has a reference of its own does not ask at which temperature machine zero was taken."""
    at_zero = zero_conditions(TRIPOD, 27.0)
    rows = rows_at_tips(TRIPOD, tips(TRIPOD, 5, 2, 60.0), at_zero)
    for id_ in ("scale_expansion", "reference_air_index"):
        effect = LIBRARY[id_]
        assert not unmet_needs(effect, rows.available, 3, at_zero=())
        from_zero, _ = evaluate_basis(effect, replace(rows, quantities_at_zero={}), {}, None)
        assert (from_zero == evaluate_basis(effect, rows, {}, None)[0]).all()
    at_zero_row = row_at_zero(TRIPOD, at_zero)
    assert not evaluate_basis(LIBRARY["scale_expansion"], at_zero_row, {}, None)[0].any(), "it reads 0 there"


@pytest.mark.parametrize("effect", [LIBRARY["link_expansion"], written("k * humidity_pct"), PYTHON])
def test_a_quantity_that_zero_has_not_is_no_default(effect: Effect) -> None:
    at_zero = {"pressure_hPa": 1000.0}
    rows = row_at_zero(TRIPOD, quantities_at_zero=at_zero)
    needed = [problem.what for problem in unmet_needs(effect, rows.available, 3, rows.quantities_at_zero)]
    assert needed
    assert all("as it was at machine zero, where it was not measured" in what for what in needed)
    with pytest.raises(CompdError) as in_rows:
        evaluate_basis(effect, rows, {}, None)
    live = replace(TRIPOD, effects=(FittedEffect(effect, np.ones(1)),), constants=machine_constants(TRIPOD, DETAILS))
    values = GaugeValues(np.zeros(3), np.zeros(9), np.zeros(9), {n: v[0] for n, v in rows.quantities.items()}, 0.0)
    values = values._replace(quantities_at_zero=at_zero)
    with pytest.raises(CompdError, match="at machine zero") as in_loop:
        compensate_cmm(live, values, WarmStart.at_zero(live))
    assert str(in_rows.value) == str(in_loop.value)


@pytest.mark.parametrize("effect", [LIBRARY["link_expansion"], LIBRARY["link_elasticity"], *FORMULAS[:6], PYTHON])
def test_rows_of_an_old_recording_keep_their_meaning(effect: Effect) -> None:
    """Where the quantities at machine zero are not known, an effect counts from 20 degC; and it says so."""
    at_zero = zero_conditions(TRIPOD, 23.0)
    rows = rows_at_tips(TRIPOD, tips(TRIPOD, 4, 2, 60.0), at_zero)
    old = recounted(effect, rows)
    assert (effect.counts_from, old.counts_from) == ("machine zero", "20 degC")
    basis, _ = evaluate_basis(effect, rows, constants_of(effect), None)
    again, _ = evaluate_basis(old, replace(rows, quantities_at_zero=at_zero), constants_of(effect), None)
    assert (basis == again).all(), "a model fitted so means the same beside a zero that has the quantities"
    assert recounted(old, replace(rows, quantities_at_zero=at_zero)).counts_from == "machine zero"
    if effect.id == "link_expansion":
        warming_K = np.array([at_zero[f"temperature_link_{i + 1}_degC"] - 20.0 for i in range(3)])
        assert basis[:, :, 0] == pytest.approx(1e-6 * rows.link_mm * warming_K)
    if effect is FORMULAS[0]:
        assert basis[:, 0, 0] == pytest.approx(1e-3 * rows.link_mm[:, 0] * at_zero["temperature_link_1_degC"])


@MACHINES
@pytest.mark.parametrize("machine_tool", [False, True], ids=["CMM mode", "machine-tool mode"])
def test_the_live_correction_is_that_of_the_rows(model: MachineModel, machine_tool: bool) -> None:
    """Old and new effects of one quantity beside one another, a formula and one in Python; nothing at machine zero."""
    at_zero = zero_conditions(model, 23.0)
    old = replace(LIBRARY["joint_comparator_drift"], counts_from="20 degC")
    effects = (LIBRARY["platform_expansion"], old, LIBRARY["link_expansion"], FORMULAS[3], PYTHON)
    fitted = [FittedEffect(effect, 0.7 * np.ones(len(effect.columns(model.links)))) for effect in effects]
    fitted[-1] = replace(fitted[-1], effect=replace(PYTHON, id="python"))
    live = replace(model, effects=tuple(fitted), constants=machine_constants(model, DETAILS))
    assert live.program.needed_at_zero == {
        "temperature_platform_degC",
        *(f"temperature_link_{i + 1}_degC" for i in range(model.links)),
    }
    shares = {}
    for warmer_K in (0.0, 1.3):
        quantities = {n: np.array(v + warmer_K) for n, v in at_zero.items() if n in live.program.quantities}
        values = GaugeValues(
            np.zeros(model.links), np.zeros(live.joint_weights.shape[1]), np.zeros(9), quantities, 0.0, at_zero
        )
        warm = WarmStart.at_zero(live)
        if machine_tool:
            target_mm = model.arrangement.measured_tip_mm(model.zero.contact) - model.frame.zero_origin_M_mm
            result, _ = compensate_machine_tool(live, target_mm, None, values, warm)
        else:
            result, _ = compensate_cmm(live, values, warm)
        shares[warmer_K] = {
            name: share for name, share in result.contributions.items() if name not in ("joints", "frame")
        }
    for name, share in shares[0.0].items():
        assert (np.abs(share).max() > 1e-5) if name == old.id else (np.abs(share).max() < 1e-12), name
    rows = row_at_zero(model, {n: v + 1.3 for n, v in at_zero.items()}, quantities_at_zero=at_zero)
    for each in fitted:
        if each.effect.port == "link":
            added, _ = effect_deltas(each, rows)
            assert -shares[1.3][each.effect.id] == pytest.approx(added["link"][0], rel=1e-4)
