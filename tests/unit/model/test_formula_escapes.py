"""Formulas: nothing gets out of them, whatever the text."""

from __future__ import annotations

import ast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from compd.errors import ConfigurationError
from compd.model.formula.functions import FUNCTIONS
from compd.model.formula.parser import LONGEST, parse
from tests.support.formulas import written

ALLOWED_NODES = (ast.BinOp, ast.UnaryOp, ast.Call, ast.Name, ast.Load, ast.Constant, ast.operator, ast.unaryop)
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
    found = formula.evaluate(
        {name: np.array([[0.5], [-2.0]]) for name in formula.columns},
        dict.fromkeys(formula.constants, 3.0),
        np.array([0.0, 10.0]),
        np.array([True, False]),
    )
    assert set(found) == set(formula.linear)
    assert all(value.dtype == np.float64 for value in found.values())


@settings(max_examples=400)
@given(st.text(max_size=LONGEST + 20))
def test_no_text_gets_out(text: str) -> None:
    nothing_but_arithmetic(text)


@settings(max_examples=600)
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


@settings(max_examples=800)
@given(st.lists(st.sampled_from(PIECES), max_size=40))
def test_no_heap_of_tokens_gets_out(pieces: list[str]) -> None:
    nothing_but_arithmetic("".join(pieces))
