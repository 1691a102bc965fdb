"""Formulas: what they may say, what they give, and that nothing gets out of them."""

from __future__ import annotations

import ast
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from compd.errors import ConfigurationError
from compd.model.deltas import effect_deltas
from compd.model.effect import Effect, FittedEffect
from compd.model.effect_needs import unmet_needs
from compd.model.formula.declaration import formula_effect
from compd.model.formula.evaluator import FUNCTIONS, Formula
from compd.model.formula.parser import DEEPEST, LONGEST, parse
from compd.model.library import find_effect
from compd.model.prediction import predict
from compd.model.sensitivity import effect_sensitivity, sensitivities
from tests.support.effect_rows import HEXAPOD, TRIPOD, observe_rows, random_inputs, row_at_zero

ALLOWED_NODES = (ast.BinOp, ast.UnaryOp, ast.Call, ast.Name, ast.Load, ast.Constant, ast.operator, ast.unaryop)
NAMES = ("k", "humidity_pct", "x_mm", "pi")
GRANITE = {
    "id": "granite_swelling",
    "port": "link",
    "formula": "k * (humidity_pct - 50)",
    "parameters": {"k": {"unit": "um", "plausible": [-1, 1], "source": "my notes, 2026-11"}},
}


def written(formula: str | dict[str, str], port: str = "link", parameters: str = "k", **more: Any) -> Effect:
    """An effect with parameters of one letter each, plausible from 1 to 100."""
    declared = {name: {"unit": "um", "plausible": [1, 100], "source": "notes"} for name in parameters.split()}
    return formula_effect({"id": "mine", "port": port, "formula": formula, "parameters": declared, **more}, "a.yaml:7")


def value_of(formula: Formula, **at: float) -> float:
    """The factor of the parameter k with the other names at these values."""
    found, _ = formula.evaluate(
        {name: np.array([[value]]) for name, value in at.items()},
        {},
        np.zeros(1),
        np.ones(1, bool),
        (None,) * formula.lags,
    )
    return float(found["k"][0, 0])


# --- nothing gets out ----------------------------------------------------------------------------------

ESCAPES = [
    "().__class__",
    "k.__class__",
    "k.real",
    "__import__('os')",
    "__import__(os)",
    "eval(k)",
    "exec(k)",
    "open(k)",
    "getattr(k, k)",
    "k[0]",
    "k['a']",
    "[k]",
    "{k}",
    "{k: k}",
    "(k, k)",
    "lambda: k",
    "(lambda x: x)(k)",
    "k if k else k",
    "k and k",
    "not k",
    "k < 1",
    "k == k",
    "k in k",
    "k is k",
    "[k for k in k]",
    "{k for k in k}",
    "k := 2",
    "(k := 2)",
    "*k",
    "k(*k)",
    "sin(x=k)",
    "sin(*k)",
    "sin(**k)",
    "f'{k}'",
    "'a'",
    "b'a'",
    "...",
    "None",
    "True",
    "1j",
    "k @ k",
    "k // 2",
    "k % 2",
    "k << 2",
    "k | k",
    "k & k",
    "k ^ k",
    "~k",
    "await k",
    "yield k",
    "k; k",
    "k = 2",
    "import os",
    "k\nk",
    "k\\\nk",
    "k # comment",
    "sin",
    "sin.k",
    "sin(k)(k)",
    "(sin)(k)(k)",
    "lag",
    "lag(k)",
    "lag(k, k * 2)",
    "lag(k, -3)",
    "lag(k, 0)",
    "lag(k, sin(1))",
    "lag(k, humidity_pct)",
    "k ** humidity_pct",
    "9 ** 9 ** 9 * k",
    "k * 2 ** 11",
    "k * 2 ** (1 + 1)",
    "k * 1e999",
    "k * 1e309",
    "reference_x_mm * k",
    "k * model_x_mm",
    "k * __builtins__",
    "k * time",
    "k * reference_link_1_mm",
    "",
    " ",
    "k *",
    "(k",
    "k)",
    "k k",
    "0x1for k in k",
    "1if k else 2",
    "k" * (LONGEST + 1),
    "-" * 250 + "k",
    "(" * 140 + "k" + ")" * 139,
    "sin(" * 50 + "k" + ")" * 50,
    "k\u00b7x",
    "\uff4b",
    "k\x00",
    "minimum(k)",
    "minimum(k, k, k)",
    "abs()",
    "k + 1",
    "1",
    "humidity_pct",
    "k * humidity_pct + humidity_pct",
    "k ** 2",
    "sin(k)",
]


@pytest.mark.parametrize("text", ESCAPES)
def test_what_is_no_formula_is_refused_in_words(text: str) -> None:
    with pytest.raises(ConfigurationError) as refused:
        written(text)
    assert all("a.yaml:7" in problem.where for problem in refused.value.problems)
    assert len(str(refused.value)) < 1500


def nothing_but_arithmetic(text: str) -> None:
    """Either the text is refused, or its tree holds arithmetic alone and evaluates to numbers."""
    try:
        formula = parse(text, ("k",), "test")
    except ConfigurationError:
        return
    for node in ast.walk(formula.tree):
        assert isinstance(node, ALLOWED_NODES), ast.dump(node)
        if isinstance(node, ast.Call):
            assert isinstance(node.func, ast.Name)
            assert node.func.id in (*FUNCTIONS, "lag")
            assert not node.keywords
        if isinstance(node, ast.Constant):
            assert type(node.value) in (int, float)
    assert not any(name.startswith(("reference_", "model_")) for name in formula.columns)
    found, _ = formula.evaluate(
        {name: np.array([[0.5], [-2.0]]) for name in formula.columns},
        dict.fromkeys(formula.constants, 3.0),
        np.array([0.0, 10.0]),
        np.array([True, False]),
        (None,) * formula.lags,
    )
    assert set(found) == set(formula.linear)
    assert all(value.dtype == np.float64 for value in found.values())


@settings(deadline=None, max_examples=400)
@given(st.text(max_size=LONGEST + 20))
def test_no_text_gets_out(text: str) -> None:
    nothing_but_arithmetic(text)


@settings(deadline=None, max_examples=600)
@given(st.text(alphabet="k0129.exsinlagpow_+-*/(), []'\":=<lmbd", max_size=60))
def test_no_text_of_tempting_characters_gets_out(text: str) -> None:
    nothing_but_arithmetic(text)


PIECES = [  # not formatted: a list to choose from
    "k",
    "1",
    "9",
    "**",
    "*",
    "+",
    "-",
    "/",
    "(",
    ")",
    ",",
    "sin",
    "lag",
    "pi",
    "humidity_pct",
    "reference_x_mm",
    ".",
    "__class__",
    "[",
    "]",
    "lambda",
    ":",
    "if",
    "else",
    "for",
    "in",
    "=",
    ":=",
    "'",
    "e9",
    "_",
    " ",
]


@settings(deadline=None, max_examples=800)
@given(st.lists(st.sampled_from(PIECES), max_size=40))
def test_no_heap_of_tokens_gets_out(pieces: list[str]) -> None:
    nothing_but_arithmetic("".join(pieces))


# --- what formulas give --------------------------------------------------------------------------------

Made = tuple[str, float]  # a text, and its value computed beside it


def combined(children: st.SearchStrategy[Made]) -> st.SearchStrategy[Made]:
    def binary(left: Made, right: Made, sign: str) -> Made:
        value = {"+": left[1] + right[1], "-": left[1] - right[1], "*": left[1] * right[1]}[sign]
        return f"({left[0]} {sign} {right[0]})", value

    return st.one_of(
        st.builds(binary, children, children, st.sampled_from("+-*")),
        st.builds(lambda one: (f"-{one[0]}", -one[1]), children),
        st.builds(lambda one: (f"sin({one[0]})", math.sin(one[1])), children),
        st.builds(lambda one: (f"abs({one[0]})", abs(one[1])), children),
        st.builds(lambda a, b: (f"maximum({a[0]}, {b[0]})", max(a[1], b[1])), children, children),
    )


LEAVES = st.one_of(
    st.floats(0.001, 1000).map(lambda value: (repr(value), value)),
    st.just(("humidity_pct", 47.5)),
    st.just(("x_mm", -1.25)),
    st.just(("pi", math.pi)),
)


@settings(deadline=None, max_examples=300)
@given(st.recursive(LEAVES, combined, max_leaves=6))
def test_a_formulas_value_is_pythons(made: Made) -> None:
    text, value = made
    assume(len(text) < LONGEST - 10)
    formula = parse(f"k * {text}", ("k",), "test")
    assert value_of(formula, humidity_pct=47.5, x_mm=-1.25) == pytest.approx(value, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(
    ("text", "linear", "shape"),
    [
        ("k * x_mm", ["k"], []),
        ("a * x_mm + b * sin(w * x_mm)", ["a", "b"], ["w"]),
        ("k * (x_mm - x0)", ["k"], ["x0"]),
        ("-k * x_mm / (1 + b * x_mm)", ["k"], ["b"]),
        ("k * exp(-time_s / tau)", ["k"], ["tau"]),
        ("a * b * x_mm", ["a"], ["b"]),
        ("x_mm * k / 3 - (k - b) * 2", ["k", "b"], []),
        ("k * abs(x_mm) ** p", ["k"], ["p"]),
        ("k * lag(x_mm, tau)", ["k"], ["tau"]),
    ],
)
def test_parameters_are_linear_or_searched(text: str, linear: list[str], shape: list[str]) -> None:
    formula = parse(text, tuple(sorted((*linear, *shape), key=text.index)), "test")
    assert sorted(formula.linear) == sorted(linear)
    assert list(formula.constants) == shape


def test_each_parameter_gets_its_own_factor() -> None:
    formula = parse("x_mm * k / 4 - (k - b) * 2", ("k", "b"), "test")
    found, _ = formula.evaluate({"x_mm": np.array([[8.0], [12.0]])}, {}, np.zeros(2), np.ones(2, bool), ())
    np.testing.assert_allclose(found["k"][:, 0], [0.0, 1.0])
    np.testing.assert_allclose(np.broadcast_to(found["b"], (2, 1))[:, 0], 2.0)


def test_arithmetic_that_fails_gives_nan_and_no_warning() -> None:
    formula = parse("k * log(x_mm) / (x_mm - x_mm)", ("k",), "test")
    assert math.isnan(value_of(formula, x_mm=-1.0))


# --- effects -------------------------------------------------------------------------------------------


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
    basis, _ = effect.basis(rows, shape, None)
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
    basis, memory = effect.basis(rows, {"w": 3.0}, None)
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
    basis, _ = effect.basis(row_at_zero(), {}, None)
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
    np.testing.assert_allclose(of_links.basis(rows, {}, None)[0][0, :, 0], [1, 2, 3])


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
    ("text", "value"),
    [
        ("tan(45 * deg)", 1.0),
        ("atan2(1, -1)", 0.75 * math.pi),
        ("sin(2 * (15 * deg))", 0.5),
        ("180 * deg / pi", 1.0),
    ],
)
def test_angles(text: str, value: float) -> None:
    assert value_of(parse(f"k * {text}", ("k",), "test")) == pytest.approx(value)


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


def test_the_place_in_the_formula_is_named() -> None:
    with pytest.raises(ConfigurationError, match="character 16"):
        written("k * (1 + x_mm) @ 2")
    with pytest.raises(ConfigurationError, match=f"{DEEPEST} levels"):
        written("k * " + "sin(" * DEEPEST + "x_mm" + ")" * DEEPEST)
