"""Periods of effects that no grid holds: found in a residual, tried with the effect, fitted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from compd.arrays import FloatArray
from compd.comparison.alignment.aligned_recording import AlignedRecording
from compd.comparison.period_search import promising_constants
from compd.comparison.recording_comparison import compare
from compd.comparison.shape_search import search_constants
from compd.model.library import find_effect
from tests.support.external_recordings import record_external
from tests.support.hidden_effects import LIBRARY, NOISE_UM, record_with_effects

CYCLIC = LIBRARY["scale_cyclic"]
SIGMA_UM = np.full(3, NOISE_UM)


def record_cyclic(path: Path, period_mm: float, theta_um: FloatArray) -> AlignedRecording:
    """A tripod, whose description says a period of 0.02 mm, with cyclic errors of another one."""
    still = record_with_effects(path / "still.csv", 1, {})
    tip = still.columns(CYCLIC, {"p": period_mm}) @ theta_um * 1e3
    return record_with_effects(path / "run.csv", 1, {}, extra_um=tip)


@pytest.mark.parametrize(
    ("period_mm", "sizes_um"), [(1.37, (0.4, 0.1)), (5.08, (0.25, 0.1)), (1.37, (0.02, 0.3))], ids=str
)
def test_the_pitch_of_a_screw_is_found(tmp_path: Path, period_mm: float, sizes_um: tuple[float, float]) -> None:
    theta_um = np.repeat(sizes_um, 6) * np.array([1, -1, 0.8, 0.5, 1, -0.7, 1, 0.6, -1, 0.4, -0.8, 1])
    aligned = record_cyclic(tmp_path, period_mm, theta_um)
    comparison = compare(aligned)
    found = promising_constants(CYCLIC, aligned, comparison.residual_um, comparison.used)
    assert found.constants[0]["p"] == pytest.approx(period_mm, rel=3e-3)
    assert found.searched_parameters == 9
    result = search_constants(aligned, (), CYCLIC, SIGMA_UM)
    assert result.fitted[0].constants["p"] == pytest.approx(period_mm, rel=1e-3)
    np.testing.assert_allclose(result.fitted[0].theta, theta_um, atol=0.06)
    assert result.rms_um < 1.05 * NOISE_UM


@pytest.mark.parametrize("size_um", [0.0, 0.06])
def test_the_described_period_stays_where_no_other_is_evident(tmp_path: Path, size_um: float) -> None:
    aligned = record_cyclic(tmp_path, 0.02, np.repeat([size_um, 0.0], 6))
    assert search_constants(aligned, (), CYCLIC, SIGMA_UM).fitted[0].constants == {"p": 0.02}


def test_a_period_of_an_effect_written_as_a_formula_is_found(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    slide_mm = rng.uniform(0, 80, 250)
    error_um = 3 * np.sin(2 * np.pi * slide_mm / 1.37 + 0.4)
    aligned = record_external(tmp_path / "run.csv", {"slide_mm": slide_mm}, {"x": error_um}, sigma_um=1.0)
    size = {"unit": "um", "plausible": [-9, 9], "source": "test"}
    screw = find_effect(
        {
            "id": "screw",
            "port": "reference",
            "axis": "x",
            "formula": "a * sin(2 * pi * slide_mm / p) + b * cos(2 * pi * slide_mm / p)",
            "parameters": {"a": size, "b": size, "p": {"unit": "mm", "plausible": [0.5, 20], "source": "pitches"}},
        },
        "test",
    )
    fitted = search_constants(aligned, (), screw, np.ones(1)).fitted[0]
    assert fitted.constants["p"] == pytest.approx(1.37, abs=1e-3)
    np.testing.assert_allclose(fitted.theta, [3 * np.cos(0.4), 3 * np.sin(0.4)], atol=0.4)


def test_an_effect_without_a_period_has_nothing_to_search(tmp_path: Path) -> None:
    aligned = record_with_effects(tmp_path / "run.csv", 1, {})
    comparison = compare(aligned)
    found = promising_constants(LIBRARY["backlash"], aligned, comparison.residual_um, comparison.used)
    assert (found.constants, found.searched_parameters) == ([], 0)
