"""Which parameters of a formula are periods of a column, so that they are looked for in a residual."""

from __future__ import annotations

import pytest

from compd.model.library import find_effect


@pytest.mark.parametrize(
    ("formula", "parameters", "periods"),
    [
        ("a * sin(2 * pi * slide_mm / p) + b * cos(2 * pi * slide_mm / p)", "abp", {"p": "slide_mm"}),
        ("a * sin(2 * pi / p * (slide_mm - 3) + f)", "apf", {"p": "slide_mm", "f": ""}),
        ("a * sin(6.283185 * slide_mm / p)", "ap", {"p": "slide_mm"}),
        ("a * cos(4 * pi * slide_mm / p)", "ap", {"p": "slide_mm"}),
        # the argument grows by 1 rad, not by a turn
        ("a * sin(slide_mm / p)", "ap", {"p": ""}),
        # a frequency
        ("a * sin(2 * pi * slide_mm * p)", "ap", {"p": ""}),
        ("a * sin(2 * pi * log(slide_mm) / p)", "ap", {"p": ""}),
        ("a * sin(2 * pi * slide_mm**2 / p**2)", "ap", {"p": ""}),
        ("a * lag(slide_mm, t)", "at", {"t": ""}),
    ],
)
def test_a_period_is_recognized(formula: str, parameters: str, periods: dict[str, str]) -> None:
    declared = {name: {"unit": "mm", "plausible": [0.1, 10.0], "source": "test"} for name in parameters}
    effect = find_effect(
        {"id": "x", "port": "reference", "axis": "x", "formula": formula, "parameters": declared}, "test"
    )
    assert {constant.name: constant.period_of for constant in effect.constants} == periods
