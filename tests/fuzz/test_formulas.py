"""A formula is an effect, or is refused; an effect gives numbers, or nan, and no warning."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from compd.errors import ConfigurationError
from compd.model.formula import FUNCTIONS
from compd.model.formula.parser import parse
from tests.fuzz.bounds import examples, is_told, refusal
from tests.support.formulas import written

PIECES = (
    *sorted(FUNCTIONS), "k", "j", "scale", "temperature_room_degC", "humidity_pct", "temperature_link", "time_s",
    "pi", "e",
    "+", "-", "*", "/", "**", "//", "%", "(", ")", ",", ".", "1", "2.5", "1e308", "1e-320", "0", "9**9**9", "~", "@",
    "==", "<",
    "if", "else", "lambda", ":", ":=", "__import__", "__class__", "[", "]", "{", "}", "'", '"', "\\", "\n", "\t",
    "#", ";",
    "1_0", "0x1", "1j", "True", "None", "not", "and", "\u00b2", "\uff4b", "\u0130", "\x00", "_",
)  # fmt: skip
TEXTS = st.one_of(
    st.lists(st.sampled_from(PIECES), max_size=14).map(" ".join),
    st.lists(st.sampled_from(PIECES), max_size=14).map("".join),
    st.text(max_size=40),
    st.sampled_from(["(" * 3000, "-" * 3000 + "1", "k" * 9000, "+".join(["k"] * 3000), "sin(" * 90 + "k" + ")" * 90]),
)


@given(text=TEXTS)
@examples(300)
def test_a_text_is_a_formula_or_is_refused_with_its_place(text: str) -> None:
    error = refusal(lambda: parse(text, ("k", "j"), "a.yaml:7"), ConfigurationError)
    assert is_told(error)
    assert error is None or all(problem.where.startswith("a.yaml:7") for problem in error.problems)


@given(text=TEXTS, port=st.sampled_from(["link", "frame", "joint", "scale", "tool", "nowhere", ""]))
@examples(200)
def test_a_text_is_an_effect_or_is_refused(text: str, port: str) -> None:
    assert is_told(refusal(lambda: written(text, port), ConfigurationError))


@st.composite
def expressions(draw: st.DrawFn, depth: int = 4) -> str:
    """Formulas as the language has them, with numbers of every size."""
    if depth == 0 or draw(st.booleans()):
        return draw(st.sampled_from(["k", "x"]) | st.floats(0, 1e300).map(repr))
    inside = expressions(depth - 1)
    match draw(st.integers(0, 2)):
        case 0:
            return f"({draw(inside)} {draw(st.sampled_from(['+', '-', '*', '/', '**']))} {draw(inside)})"
        case 1:
            return f"-{draw(inside)}"
        case _:
            return f"{draw(st.sampled_from(['sin', 'exp', 'sqrt', 'log', 'abs']))}({draw(inside)})"


@pytest.mark.long
@pytest.mark.sample
@given(text=expressions(), k=st.floats(-1e300, 1e300), x=st.lists(st.floats(allow_nan=True), min_size=1, max_size=4))
@examples(200)
def test_a_formula_has_a_value_or_none_and_never_a_warning(text: str, k: float, x: list[float]) -> None:
    try:
        formula = parse(text, ("k",), "a.yaml:7")
    except ConfigurationError:
        return
    column = np.array(x)[:, np.newaxis]
    columns = dict.fromkeys(formula.columns, column)
    constants = dict.fromkeys(formula.constants, k)
    rows = np.arange(len(x))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        terms = formula.evaluate(columns, constants, rows.astype(float), rows == 0)
    for term in terms.values():
        assert term.shape == (len(x), 1)
