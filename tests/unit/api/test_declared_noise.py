"""`compd.compare` where neighbouring rows contradict the noise that is declared."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

import numpy as np
import pytest

import compd
from compd.comparison import Comparison
from tests.support.external import write_external

Compare: TypeAlias = Callable[[Path], Comparison]


def compared_sample(path: Path) -> Comparison:
    return compd.compare(compd.open_sample(path))


DRIFT = np.linspace(-1, 1, 300)


def recorded(directory: Path, declared_um: float, drift_um: float, sigma_um: float) -> Path:
    rng = np.random.default_rng(8)
    place = rng.uniform(-100, 100, 300)
    error_um = rng.normal(0, sigma_um, 300) + drift_um * DRIFT
    reference = {"quantity": "tool_position", "frame": "machine", "sigma_um": declared_um}
    return write_external(directory, {"model_x_mm": place, "reference_x_mm": place + error_um * 1e-3}, reference)


@pytest.mark.parametrize(
    ("declared_um", "drift_um", "sigma_um"), [(1.0, 0.0, 8.0), (10.0, 11.0, 6.5)], ids=["too small", "a drift"]
)
@pytest.mark.parametrize("compare", [compd.compare, compared_sample])
def test_both_numbers_are_said(
    tmp_path: Path, declared_um: float, drift_um: float, sigma_um: float, compare: Compare
) -> None:
    comparison = compare(recorded(tmp_path, declared_um, drift_um, sigma_um))
    assert (comparison.floor.source, comparison.at_floor) == ("estimate", False)
    assert comparison.floor.um == pytest.approx(sigma_um, rel=0.15)
    assert comparison.floor.declared_um == declared_um
    assert f"Noise of {declared_um:.1f}" in comparison.verdict
    assert "neighbouring rows scatter by" in comparison.verdict
    assert comparison.as_json()["noise_floor_remark"] == comparison.floor.contradiction != ""


@pytest.mark.parametrize("compare", [compd.compare, compared_sample])
def test_a_declaration_that_rows_agree_with_stays(tmp_path: Path, compare: Compare) -> None:
    comparison = compare(recorded(tmp_path, 8.0, 0.0, 8.0))
    assert (comparison.floor.source, comparison.floor.um) == ("declared", 8.0)
    assert comparison.at_floor
