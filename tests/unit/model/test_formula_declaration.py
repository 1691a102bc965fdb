"""Effects declared as formulas: what they do at their ports, and which declarations are refused."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from compd.errors import ConfigurationError
from compd.model.deltas import effect_deltas
from compd.model.effects.effect import Effect, FittedEffect
from compd.model.effects.effect_basis import evaluate_basis
from compd.model.effects.effect_needs import unmet_needs
from compd.model.formula.declaration import formula_effect
from compd.model.library import find_effect
from compd.model.prediction import predict
from compd.model.sensitivity import sensitivities
from tests.support.effect_derivatives import effect_sensitivity
from tests.support.effect_rows import HEXAPOD, TRIPOD, observe_rows, random_inputs, row_at_zero
from tests.support.formulas import written

GRANITE = {
    "id": "granite_swelling",
    "port": "link",
    "formula": "k * (humidity_pct - 50)",
    "parameters": {"k": {"unit": "um", "plausible": [-1, 1], "source": "my notes, 2026-11"}},
}


def test_the_persons_example() -> None:
    effect = find_effect(GRANITE, "model.yaml:12")
    assert effect.needs == ("humidity_pct",)
    rows = row_at_zero(values={"humidity_pct": 53.0})
    found, _ = effect_deltas(FittedEffect(effect, np.array([0.1])), rows)
    np.testing.assert_allclose(found["link"], 0.3e-3)
    (problem,) = unmet_needs(effect, rows.available - {"humidity_pct"}, 3)
    assert "a hygrometer" in problem.next_step


def test_temperature_link_is_the_links_own() -> None:
    effect = written("k * (temperature_link - 20) * link_mm / 1000")
    rows = row_at_zero(values={"temperature_link_2_degC": 21.5})
    found, _ = effect_deltas(FittedEffect(effect, np.array([2.0])), rows)
    np.testing.assert_allclose(found["link"][0] / (2e-3 * rows.link_mm[0] / 1000), [0, 1.5, 0], atol=1e-12)
    assert written("k * strain_link_ppm").needs == ("strain_link_{link}_ppm",)


@pytest.mark.parametrize("model", [TRIPOD, HEXAPOD], ids=["tripod", "hexapod"])
@pytest.mark.parametrize(
    "more",
    [{"port": port} for port in ("scale", "joint", "frame", "link")]
    + [
        {"port": port, "axis": axis}
        for port, axis in zip(("base_joint", "platform_joint", "plate", "tool", "reference"), "xyzxy", strict=True)
    ],
    ids=lambda more: more["port"],
)
def test_a_formula_serves_every_port_and_moves_the_tip(model: object, more: dict[str, str]) -> None:
    machine = TRIPOD if model is TRIPOD else HEXAPOD
    effect = written(
        "k * (temperature_room_degC - 20) + m * sin(humidity_pct) + n * lag(pressure_hPa - 1010, tau)",
        parameters="k m n tau",
        **more,
    )
    arguments = random_inputs(machine, 6)
    rows = observe_rows(machine, arguments)
    shape = effect.constant_grid(rows)[3]
    theta = np.array([1.0, -2.0, 0.5])
    found, _ = effect_deltas(FittedEffect(effect, theta, shape), rows)
    moved = predict(machine, rows, found).tip_mm - predict(machine, rows, {}).tip_mm
    basis, _ = evaluate_basis(effect, rows, shape, None)
    by = effect_sensitivity(effect, rows, basis, sensitivities(machine, rows, effect.ports))
    np.testing.assert_allclose(by.tip @ theta, moved, atol=1e-3 * np.abs(moved).max())
    if more["port"] == "reference":
        np.testing.assert_allclose(moved[:, [0, 2]], 0, atol=1e-12)


def test_a_lag_in_a_formula_remembers() -> None:
    effect = written("k * lag(temperature_room_degC, 500) + m * lag(humidity_pct, tau)", parameters="k m tau")
    assert effect.remembers
    assert {"time", "order"} <= set(effect.needs)
    arguments = random_inputs(TRIPOD, 9)
    rows = observe_rows(TRIPOD, arguments)
    fitted = FittedEffect(effect, np.array([1.0, 2.0]), {"tau": 60.0})
    whole, _ = effect_deltas(fitted, rows)
    memory = None
    for i in range(9):
        from tests.support.effect_rows import select_rows

        one, memory = effect_deltas(fitted, observe_rows(TRIPOD, select_rows(arguments, slice(i, i + 1))), memory)
        np.testing.assert_array_equal(one["link"][0], whole["link"][i])


def test_one_parameter_per_link() -> None:
    declared = {"k": {"unit": "um", "plausible": [-1, 1], "source": "notes", "per": "link"}}
    effect = formula_effect(
        {"id": "mine", "port": "link", "formula": "k * direction", "parameters": declared}, "a.yaml:7"
    )
    found, _ = effect_deltas(FittedEffect(effect, np.array([1.0, 2.0, 3.0])), row_at_zero())
    np.testing.assert_allclose(found["link"][0], [1e-3, 2e-3, 3e-3])
    assert effect.needs == ("direction",)


AXIS_TILT = {"x": "-k * sin(a_deg * deg) * tan(e_deg * deg)", "y": "-k * cos(a_deg * deg)"}


def test_formulas_on_several_axes_share_their_parameters() -> None:
    effect = written(AXIS_TILT, port="reference")
    assert effect.needs == ("a_deg", "e_deg")
    assert "delta_y = -k * cos(a_deg * deg)" in effect.equation
    rows = row_at_zero(values={"a_deg": 30.0, "e_deg": 45.0})
    found, _ = effect_deltas(FittedEffect(effect, np.array([2.0])), rows)
    np.testing.assert_allclose(found["reference"][0], [-1e-3, -math.sqrt(3) * 1e-3, 0, 0, 0, 0], atol=1e-15)


def test_a_parameter_that_one_axis_is_not_linear_in_is_searched_on_all() -> None:
    effect = written({"x": "a * sin(w * x_mm)", "z": "a * w + b * lag(x_mm, w)"}, port="tool", parameters="a b w")
    assert [parameter.name for parameter in effect.parameters] == ["a", "b"]
    assert [constant.name for constant in effect.constants] == ["w"]
    rows = row_at_zero(values={"x_mm": 0.5})
    basis, memory = evaluate_basis(effect, rows, {"w": 3.0}, None)
    np.testing.assert_allclose(basis[0], 1e-3 * np.array([[math.sin(1.5), 0], [0, 0], [3.0, 0.5]]))
    assert len(memory or ()) == 3
    with pytest.raises(ConfigurationError, match="formula of mine, z: a term of the formula holds no parameter"):
        written({"x": "a * sin(w * x_mm)", "z": "w * x_mm"}, port="tool", parameters="a w")


def test_formulas_on_all_axes_of_each_joint_with_one_parameter_per_link() -> None:
    declared = {
        name: {"unit": "um", "plausible": [-1, 1], "source": "s", "per": per}
        for name, per in (("k", "link"), ("m", "machine"))
    }
    effect = formula_effect(
        {"id": "mine", "port": "base_joint", "formula": {"x": "k * direction", "y": "m"}, "parameters": declared}, "a"
    )
    basis, _ = evaluate_basis(effect, row_at_zero(), {}, None)
    expected = np.zeros((9, 4))
    expected[[0, 3, 6], [0, 1, 2]] = 1e-3
    expected[[1, 4, 7], 3] = 1e-3
    np.testing.assert_allclose(basis[0], expected)


def test_a_sensitivity_is_a_parameter_times_recorded_derivatives() -> None:
    effect = sensitive(port="reference")
    assert effect.needs == ("d_radius_{axis}_mm",)
    rows = row_at_zero(values={"d_radius_x_mm": 0.4, "d_radius_z_mm": -2.0})
    assert not unmet_needs(effect, rows.available, 3)
    found, _ = effect_deltas(FittedEffect(effect, np.array([0.1])), rows)
    np.testing.assert_allclose(found["reference"][0], [0.04, 0, -0.2, 0, 0, 0])
    problems = unmet_needs(effect, row_at_zero().available, 3)
    assert "d_radius_x_mm" in str(problems[0])
    of_links = sensitive(port="link")
    assert of_links.needs == ("d_radius_link_{link}_mm",)
    rows = row_at_zero(values={f"d_radius_link_{i}_mm": float(i) for i in (1, 2, 3)})
    np.testing.assert_allclose(evaluate_basis(of_links, rows, {}, None)[0][0, :, 0], [1, 2, 3])


def sensitive(**more: Any) -> Effect:
    declared = {"dr": {"unit": "mm", "plausible": [-1, 1], "source": "drawing"}}
    return formula_effect({"id": "radius", "sensitivity": "radius", "parameters": declared, **more}, "a.yaml:7")


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"port": "reference", "formula": "dr"}, "has a formula and a sensitivity"),
        ({"port": "tool"}, "a.yaml:7, port: has no sensitivity"),
        ({"port": "reference", "axis": "x"}, "a.yaml:7, axis: does not belong to a sensitivity"),
        ({"port": "reference", "gives": "mm"}, "a.yaml:7, gives: does not belong"),
        (
            {
                "port": "reference",
                "parameters": {name: {"unit": "1", "plausible": [0, 1], "source": "s"} for name in "ab"},
            },
            "a sensitivity has one parameter",
        ),
        (
            {"port": "reference", "parameters": {"a": {"unit": "1", "plausible": [1, 0], "source": "s"}}},
            "range is empty",
        ),
    ],
)
def test_a_wrong_sensitivity_is_refused(more: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigurationError, match=said):
        sensitive(**more)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"port": "engine"}, "port"),
        ({"colour": "red"}, "unknown key"),
        ({"parameters": {}}, "at least 1"),
        ({"parameters": {"k": {"unit": "um", "plausible": [1, -1], "source": "s"}}}, "range is empty"),
        ({"parameters": {"k": {"unit": "um", "plausible": [-1, math.inf], "source": "s"}}}, "finite"),
        ({"parameters": {"k": {"unit": "um", "plausible": [-1, 1]}}}, "source"),
        ({"port": "tool"}, "does not fit the port tool"),
        ({"axis": "x"}, "this port has no direction"),
        ({"port": "frame", "formula": "k * temperature_link"}, "has no links"),
        ({"formula": "k * humidity"}, "is no column"),
        ({"formula": "humidity_pct"}, "a parameter is not in the formula"),
        ({"id": "Not an id"}, "pattern"),
        ({"formula": {"x": "k"}}, "the port link has no axes"),
        ({"formula": {"w": "k"}, "port": "tool"}, "formula.w: is none of the choices"),
        ({"formula": {}, "port": "tool"}, "at least 1"),
        ({"formula": {"x": "k"}, "port": "tool", "axis": "x"}, "axis: is said twice"),
        ({"formula": {"x": "k", "y": "k +"}, "port": "tool"}, "formula of granite_swelling, y, character"),
        ({"formula": None}, "`formula:` or `sensitivity:`"),
        ({"paramters": {}}, "did you mean `parameters`"),
        ({"parameters": {"deg": {"unit": "um", "plausible": [-1, 1], "source": "s"}}, "formula": "deg"}, "a number's"),
    ],
)
def test_a_wrong_declaration_is_refused_with_its_place(change: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigurationError, match=said) as refused:
        find_effect({**GRANITE, **change}, "model.yaml:12")
    assert all(problem.where.startswith("model.yaml:12") for problem in refused.value.problems)
