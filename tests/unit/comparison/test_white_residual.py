"""Whether a residual is white, where somebody declared more noise than it has, or less."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from compd.comparison import (
    Comparison,
    compare,
    counted_by_neighbours,
    open_recording,
)
from tests.support.external import Floats, write_external

DECLARED_UM = 10.0


def compared(directory: Path, residual_um: Floats, declared_um: float = DECLARED_UM, **columns: Floats) -> Comparison:
    place = np.random.default_rng(8).uniform(-100, 100, len(residual_um))
    if "visit" in columns:
        _, first, of_visit = np.unique(columns["visit"], return_index=True, return_inverse=True)
        place = place[first][of_visit]
    reference = {"quantity": "tool_position", "frame": "machine", "sigma_um": declared_um}
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


def what_is_left(
    directory: Path, left_um: Floats, declared_um: float = 1.0, **columns: Floats
) -> tuple[Comparison, Comparison | None]:
    """A comparison whose residual is left, and the same counted by it."""
    before = compared(directory, left_um, declared_um, **columns)
    return before, counted_by_neighbours(before, before.residual_um)


def test_a_declaration_that_is_too_small_gives_way_to_what_neighbours_show(tmp_path: Path) -> None:
    before, counted = what_is_left(tmp_path, noise())
    assert before.floor.source == "declared"
    assert counted is not None
    assert (counted.floor.source, counted.floor.above_declared) == ("estimate", True)
    assert counted.floor.um == pytest.approx(8.0, rel=0.15)
    assert "1.00 um is declared" in counted.floor.contradiction


@pytest.mark.parametrize("declared_um", [5.0, 8.0, 12.0])
def test_a_declaration_within_a_factor_of_two_stays(tmp_path: Path, declared_um: float) -> None:
    assert what_is_left(tmp_path, noise(), declared_um)[1] is None


@pytest.mark.parametrize("shape", ["wave", "alternating", "quantity"])
def test_what_follows_an_order_is_no_reason_to_doubt_a_declaration(tmp_path: Path, shape: str) -> None:
    rows, force = np.arange(300), np.random.default_rng(9).uniform(0, 10, 300)
    left = {"wave": 9.0 * np.sin(rows / 40), "alternating": 8.0 * (-1.0) ** rows, "quantity": 3.0 * (force - 5)}[shape]
    assert what_is_left(tmp_path, noise(sigma_um=2.0) + left, force_N=force)[1] is None


def test_a_few_repeats_that_agree_show_that_neighbours_differ_by_an_effect(tmp_path: Path) -> None:
    left, visit = noise(), np.arange(300.0)
    for first in (10, 100, 200):
        visit[first + 1] = visit[first]
        left[first + 1] = left[first] + 0.5
    before, counted = what_is_left(tmp_path, left, visit=visit)
    assert before.floor.source == "declared"
    assert counted is None
