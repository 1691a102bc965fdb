"""Whether a residual is white, where somebody declared more noise than it has."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from compd.comparison import Comparison, compare, counted_by_neighbours, open_recording
from tests.support.external import Floats, write_external

DECLARED_UM = 10.0


def compared(directory: Path, residual_um: Floats, **columns: Floats) -> Comparison:
    place = np.random.default_rng(8).uniform(-100, 100, len(residual_um))
    reference = {"quantity": "tool_position", "frame": "machine", "sigma_um": DECLARED_UM}
    path = write_external(
        directory,
        {"model_x_mm": place, "reference_x_mm": place + residual_um * 1e-3, **columns},
        reference,
    )
    return compare(open_recording(path))


def noise(rows: int = 300, sigma_um: float = 8.0) -> Floats:
    return np.random.default_rng(7).normal(0, sigma_um, rows)


def test_white_noise_that_was_declared_stays_so(tmp_path: Path) -> None:
    assert counted_by_neighbours(compared(tmp_path, noise())) is None


@pytest.mark.parametrize("shape", ["line", "wave", "step"])
def test_a_drift_within_the_declared_noise_is_no_noise(tmp_path: Path, shape: str) -> None:
    share = np.linspace(-1, 1, 300)
    drift = {"line": 11.0 * share, "wave": 9.0 * np.sin(7 * share), "step": 7.0 * np.sign(share)}[shape]
    before = compared(tmp_path, noise(sigma_um=6.5) + drift)
    assert before.floor.source == "declared"
    counted = counted_by_neighbours(before)
    assert counted is not None
    assert counted.floor.source == "estimate"
    assert counted.floor.um == pytest.approx(6.5, rel=0.15)
    assert counted.floor.contradiction.startswith("x follows time (")
    assert "10.0 um" in counted.floor.contradiction


def test_what_follows_a_measured_quantity_is_no_noise(tmp_path: Path) -> None:
    force = np.random.default_rng(9).uniform(0, 10, 300)
    counted = counted_by_neighbours(compared(tmp_path, noise(sigma_um=6.5) + 2.0 * (force - 5), force_N=force))
    assert counted is not None
    assert counted.floor.contradiction.startswith("x follows force_N (")
