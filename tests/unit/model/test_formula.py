"""Formulas: what they give, and which of their parameters are linear."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from compd.errors import ConfigurationError
from compd.model.formula.formula import Formula
from compd.model.formula.parser import DEEPEST, LONGEST, parse
from tests.support.formulas import written


def value_of(formula: Formula, **at: float) -> float:
    """The factor of the parameter k with the other names at these values."""
    found = formula.evaluate(
        {name: np.array([[value]]) for name, value in at.items()},
        {},
        np.zeros(1),
        np.ones(1, bool),
    )
    return float(found["k"][0, 0])


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


@settings(max_examples=300)
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
    found = formula.evaluate({"x_mm": np.array([[8.0], [12.0]])}, {}, np.zeros(2), np.ones(2, bool))
    np.testing.assert_allclose(found["k"][:, 0], [0.0, 1.0])
    np.testing.assert_allclose(np.broadcast_to(found["b"], (2, 1))[:, 0], 2.0)


def test_arithmetic_that_fails_gives_nan_and_no_warning() -> None:
    formula = parse("k * log(x_mm) / (x_mm - x_mm)", ("k",), "test")
    assert math.isnan(value_of(formula, x_mm=-1.0))


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


def test_the_place_in_the_formula_is_named() -> None:
    with pytest.raises(ConfigurationError, match="character 16"):
        written("k * (1 + x_mm) @ 2")
    with pytest.raises(ConfigurationError, match=f"{DEEPEST} levels"):
        written("k * " + "sin(" * DEEPEST + "x_mm" + ")" * DEEPEST)
