"""The unit of a parameter is checked against the columns that it multiplies."""

from __future__ import annotations

import pytest

from compd.model.formula import formula_effect
from compd.model.formula.unit_check import read_unit
from compd.model.library import load_effects
from tests.support.paths import CONFIG


def remarks(formula: str, unit: str, gives: str = "um") -> tuple[str, ...]:
    parameters = {"k": {"unit": unit, "plausible": [-1, 1], "source": "a test"}}
    source = {"id": "e", "port": "reference", "axis": "x", "formula": formula, "parameters": parameters}
    return formula_effect({**source, "gives": gives}, "test").remarks


@pytest.mark.parametrize(
    ("formula", "unit"),
    [
        ("k * (temperature_ram_degC - 20)", "um/K"),
        ("k * temperature_ram_degC", "um/degC"),
        ("k * position_mm / 1000", "um/m"),
        ("k * position_mm", "mrad"),
        ("k * position_mm ** 2", "um/mm^2"),
        ("k * position_mm * (lag(temperature_ram_degC, 600) - 20) / 1000", "ppm/K"),
        ("k * approach_1 / 2", "um"),
        ("k * velocity_1_mm_per_s", "ms"),
        ("k * time_s / 3600", "um/h"),
        ("k * arm_mm / 300", "um"),  # 300 is a length
        ("k * sqrt(force_z_N)", "um/sqrt(N)"),  # not a unit that is read
        ("-k * cos(elevation_deg * deg)", "arcsec"),
        ("k * sin(2 * pi * position_mm / 20)", "um"),
        ("k * abs(humidity_pct - 50)", "um/%"),
        ("k * (temperature_ram_degC - 20) * position_mm / 1000", "um/(m K)"),
    ],
)
def test_a_unit_that_fits_has_no_remark(formula: str, unit: str) -> None:
    assert remarks(formula, unit) == ()


@pytest.mark.parametrize(
    ("formula", "unit", "words"),
    [
        ("k * (temperature_ram_degC - 20)", "um/mm", "k is declared in um/mm; by the formula it is in um per degC"),
        ("k * humidity_pct", "um", "by the formula it is in um per pct"),
        ("k * position_mm ** 2", "um/mm", "in um per mm"),
        ("k * position_mm", "um/m", "the formula needs a factor of 0.001 then, not 1, to give um"),
        ("k * (temperature_ram_degC - 20)", "mm/K", "needs a factor of 1e+03 then, not 1"),
        ("k * time_s", "um/h", "needs a factor of 0.000278 then"),
    ],
)
def test_a_unit_that_does_not_is_told(formula: str, unit: str, words: str) -> None:
    (remark,) = remarks(formula, unit)
    assert words in remark


def test_what_a_formula_gives_counts() -> None:
    assert remarks("k * (temperature_ram_degC - 20)", "mm/K", gives="mm") == ()


@pytest.mark.parametrize("text", ["", "furlong", "um/turn", "um/sqrt(N)"])
def test_a_unit_that_is_not_known_is_not_judged(text: str) -> None:
    assert text == "" or read_unit(text) is None


@pytest.mark.parametrize("name", ["telescope", "plate", "axis", "stage"])
def test_effects_that_come_with_compd_have_no_remark(name: str) -> None:
    assert all(effect.remarks == () for effect in load_effects(CONFIG / "effects" / f"{name}.yaml").values())
