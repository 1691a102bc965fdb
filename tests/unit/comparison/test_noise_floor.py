"""The noise floor: repeats, declarations, estimates; gross rows; the gauges' own noise."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from compd.comparison.noise_floor import noise_floor, repeat_scatter
from compd.comparison.outliers import outlier_rows
from compd.comparison.prediction_uncertainty import gauge_noise
from tests.support.measured import GAUGE_SIGMA_UM, aligned, gauges, record

Floats = NDArray[np.float64]
UNKNOWN = np.full(3, np.nan)


def noisy(rows: int, sigma_um: float = 0.2, seed: int = 0) -> Floats:
    return np.random.default_rng(seed).normal(0, sigma_um, (rows, 3))


def everything(values: Floats) -> NDArray[np.bool_]:
    return np.ones(len(values), dtype=bool)


def pairs(rows: int) -> NDArray[np.int64]:
    return np.arange(rows) // 2


def test_repeats_see_noise_and_not_what_changes_from_visit_to_visit() -> None:
    values = noisy(2000) + np.repeat(np.random.default_rng(1).normal(0, 5, (1000, 3)), 2, axis=0)
    scatter = repeat_scatter(values, everything(values), pairs(2000))
    assert scatter is not None
    np.testing.assert_allclose(scatter.by_axis_um, 0.2, rtol=0.06)
    assert scatter.dof == 1000


def test_a_gross_repeat_does_not_raise_the_floor() -> None:
    values = noisy(400)
    values[7, 1] += 50
    scatter = repeat_scatter(values, everything(values), pairs(400))
    assert scatter is not None
    assert scatter.outlier_visits == 1
    np.testing.assert_allclose(scatter.by_axis_um, 0.2, rtol=0.15)


def test_visits_of_one_row_are_no_repeats() -> None:
    values = noisy(50)
    assert repeat_scatter(values, everything(values), np.arange(50)) is None
    assert repeat_scatter(values, everything(values), np.full(50, -1)) is None
    assert repeat_scatter(values, everything(values), None) is None


def test_visits_of_different_size_are_pooled() -> None:
    visit = np.repeat(np.arange(400), np.random.default_rng(3).integers(1, 5, 400))
    values = noisy(len(visit)) + visit[:, None]
    scatter = repeat_scatter(values, everything(values), visit)
    assert scatter is not None
    np.testing.assert_allclose(scatter.by_axis_um, 0.2, rtol=0.08)


def floor(values: Floats, visit: NDArray[np.int64] | None, declared: Floats = UNKNOWN, gauge: Floats = UNKNOWN):  # type: ignore[no-untyped-def]
    return noise_floor(values, everything(values), visit, declared, gauge, (np.arange(len(values), dtype=float),))


def test_repeats_come_first_and_agree_with_a_right_declaration() -> None:
    found = floor(noisy(200), pairs(200), np.full(3, 0.2))
    assert found.source == "repeats"
    assert "agrees" in found.how
    assert found.um == pytest.approx(0.2, rel=0.06)


def test_repeats_overrule_a_wrong_declaration() -> None:
    found = floor(noisy(400), pairs(400), np.full(3, 0.4))
    assert found.source == "repeats"
    assert "contradict" in found.how
    assert found.um == pytest.approx(0.2, rel=0.08)


def test_a_declaration_counts_with_the_gauges_noise_where_nothing_is_repeated() -> None:
    found = floor(noisy(100), None, np.full(3, 0.3), np.full(3, 0.4))
    assert found.source == "declared"
    assert found.um == pytest.approx(0.5)


def test_the_last_resort_is_an_estimate_and_called_so() -> None:
    slow = np.linspace(0, 30, 1000)[:, None]
    found = floor(noisy(1000) + slow, None)
    assert found.source == "estimate"
    assert found.um == pytest.approx(0.2, rel=0.08)


def test_rows_beyond_all_noise_are_found_and_others_are_not() -> None:
    values = noisy(5000)
    values[[17, 400, 401]] += [[0, 2, 0], [-3, 0, 0], [0, 0, 900]]
    assert np.flatnonzero(outlier_rows(values, everything(values))).tolist() == [17, 400, 401]


def test_what_a_repeat_confirms_is_not_gross() -> None:
    values = noisy(400)
    values[10:12, 0] += 5  # both rows of one visit
    values[21, 0] += 5  # one row of another
    assert np.flatnonzero(outlier_rows(values, everything(values), pairs(400))).tolist() == [21]


def test_rounded_values_have_no_gross_rows() -> None:
    values = np.round(noisy(1000, 0.3))  # mostly exact zeros: a median of nothing
    assert not outlier_rows(values, everything(values)).any()


def test_the_gauges_noise_is_their_scatter_within_visits(tmp_path: Path) -> None:
    found = gauge_noise(aligned(record(tmp_path, gauges(900, 30))))
    np.testing.assert_allclose(found.joint_mm * 1e3, GAUGE_SIGMA_UM, rtol=0.2)
    np.testing.assert_allclose(found.frame_mm * 1e3, GAUGE_SIGMA_UM, rtol=0.2)
    np.testing.assert_allclose(found.scale_mm * 1e3, 1e-3 / np.sqrt(12))  # written to a nanometre, and repeating
    assert "within visits" in found.how


def test_without_repeats_the_last_digit_is_the_least_noise(tmp_path: Path) -> None:
    columns = gauges(300, 31)
    del columns["visit"]
    found = gauge_noise(aligned(record(tmp_path, columns)))
    np.testing.assert_allclose(found.joint_mm * 1e3, 0.01 / np.sqrt(12))
    assert "lower bound" in found.how
