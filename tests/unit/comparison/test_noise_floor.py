"""The noise floor: repeats, declarations, estimates; gross rows; the gauges' own noise."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from compd.comparison.noise_floor import noise_floor, repeat_scatter
from compd.comparison.outliers import outlier_rows
from compd.comparison.prediction_uncertainty import gauge_noise
from compd.statistics import SCALE_EFFICIENCY, last_digit_um, replicate_pairs, unseen_rounding_um
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
    assert scatter.pairs == 1000
    assert scatter.dof == pytest.approx(1000 * SCALE_EFFICIENCY)


def test_a_gross_repeat_does_not_raise_the_floor() -> None:
    values = noisy(400)
    values[7, 1] += 50
    scatter = repeat_scatter(values, everything(values), pairs(400))
    assert scatter is not None
    np.testing.assert_allclose(scatter.by_axis_um, 0.2, rtol=0.15)


def test_gross_rows_in_visits_of_three_do_not_raise_the_floor() -> None:
    """About its visit's mean, one gross row of three makes three."""
    values = noisy(900)
    values[::37] += np.random.default_rng(4).normal(0, 500, values[::37].shape)
    scatter = repeat_scatter(values, everything(values), np.arange(900) // 3)
    assert scatter is not None
    np.testing.assert_allclose(scatter.by_axis_um, 0.2, rtol=0.1)


def test_rows_that_are_not_used_are_no_repeats() -> None:
    values = noisy(400)
    values[200:260] *= 50
    use = everything(values)
    use[200:260] = False
    scatter = repeat_scatter(values, use, pairs(400))
    assert scatter is not None
    assert scatter.pairs == 170
    np.testing.assert_allclose(scatter.by_axis_um, 0.2, rtol=0.15)


def test_all_pairs_have_the_degrees_of_freedom_of_their_visits() -> None:
    visit = np.repeat([3, -1, 7, 8], [4, 5, 2, 100])
    found = replicate_pairs(np.ones(len(visit), dtype=bool), visit, 12)
    assert found is not None
    assert found.dof == pytest.approx(3 + 1 + 11)
    assert (visit[found.first] == visit[found.second]).all()
    assert len(found.weight) == 6 + 1 + 66
    values = np.random.default_rng(0).normal(size=(len(visit), 1))
    of_four, of_two = values[:4, 0], values[9:11, 0]
    squares = (found.difference(values)[:, 0] ** 2 * found.weight)[:7].sum()
    assert squares == pytest.approx(3 * of_four.var(ddof=1) + of_two.var(ddof=1))


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
    digit, order = np.zeros(values.shape[1]), np.arange(len(values), dtype=float)
    return noise_floor(values, everything(values), visit, declared, gauge, digit, (order,))


def test_repeats_come_first_and_agree_with_a_right_declaration() -> None:
    found = floor(noisy(200), pairs(200), np.full(3, 0.2))
    assert found.source == "repeats"
    assert "agrees" in found.how
    assert found.um == pytest.approx(0.2, rel=0.06)


def test_repeats_overrule_a_wrong_declaration() -> None:
    found = floor(noisy(400), pairs(400), np.full(3, 0.3))
    assert found.source == "repeats"
    assert "contradict" in found.how
    assert found.um == pytest.approx(0.2, rel=0.08)
    assert found.contradiction == ""  # less than a factor 2


@pytest.mark.parametrize(("declared", "factor"), [(0.001, "times as much"), (3.0, "times less")])
def test_repeats_far_from_the_declaration_get_a_remark(declared: float, factor: str) -> None:
    found = floor(noisy(400), pairs(400), np.full(3, declared))
    assert factor in found.contradiction
    assert "sigma_um" in found.contradiction
    assert found.um == pytest.approx(0.2, rel=0.08)


def test_few_repeats_that_differ_by_chance_get_no_remark() -> None:
    values = noisy(16)[:, :1]
    assert floor(values, pairs(16), np.full(1, 0.3)).contradiction == ""


def test_too_few_repeats_leave_the_declaration() -> None:
    visit = np.where(np.arange(100) < 14, pairs(100), -1)
    assert floor(noisy(100), visit, np.full(3, 0.3)).source == "declared"
    undeclared = floor(noisy(100), visit)
    assert undeclared.source == "estimate"
    assert "7 pairs" in undeclared.how


def test_repeats_that_are_alike_have_the_uncertainty_of_the_last_digit() -> None:
    place = np.round(np.random.default_rng(5).uniform(-50, 50, (30, 1)), 1)
    values, visit = np.repeat(place, 3, axis=0), np.repeat(np.arange(30), 3)
    found = noise_floor(
        values, everything(values), visit, UNKNOWN[:1], UNKNOWN[:1], last_digit_um(values), (np.arange(90.0),)
    )
    assert found.source == "repeats"
    assert found.um == pytest.approx(0.1 / np.sqrt(12))


@pytest.mark.parametrize("noise", [0.02, 0.05, 0.1, 0.2])
def test_what_repeats_do_not_show_of_rounding_is_what_their_mean_is_off(noise: float) -> None:
    """`noise`: in steps. Many places are read six times each, and the error of each place's mean is known."""
    generator = np.random.default_rng(7)
    true = generator.uniform(0.0, 1000.0, 20_000)[:, None]
    readings = np.round(true + noise * generator.standard_normal((len(true), 6)))
    scatter2 = readings.var(axis=1, ddof=1).mean()
    in_common = np.sqrt(((readings.mean(axis=1) - true[:, 0]) ** 2).mean() - scatter2 / 6)
    unseen = unseen_rounding_um(np.array([np.sqrt(scatter2)]), np.array([12**-0.5]))
    assert unseen[0] == pytest.approx(in_common, rel=0.01)


def test_repeats_that_are_all_alike_show_nothing_of_rounding_and_loud_noise_shows_all() -> None:
    digit_um = np.array([12**-0.5, 12**-0.5, 0.0])
    assert unseen_rounding_um(np.array([0.0, 1.0, 1.0]), digit_um) == pytest.approx([12**-0.5, 0.0, 0.0], abs=1e-3)


def test_values_far_below_a_step_show_nothing_of_it() -> None:
    """As of a reference in mrad that errs by some urad: they are no multiples, 0, of 50 mrad."""
    values = np.round(np.random.default_rng(6).normal(0, 0.005, (60, 1)), 6)
    assert last_digit_um(values).tolist() == [0.0]
    assert last_digit_um(np.round(values, 3)) == pytest.approx(0.001 / np.sqrt(12))


def test_a_declaration_counts_with_the_gauges_noise_where_nothing_is_repeated() -> None:
    found = floor(noisy(100), None, np.full(3, 0.18), np.full(3, 0.24))
    assert found.source == "declared"
    assert found.um == pytest.approx(0.3)


def test_a_declaration_that_neighbouring_rows_contradict_is_no_floor() -> None:
    """A data sheet's 1.5 um, and rows that differ by 0.2 um: both numbers are said, and the smaller one counts."""
    found = floor(noisy(400), None, np.full(3, 1.5), np.zeros(3))
    assert found.source == "estimate"
    assert found.um == pytest.approx(0.2, rel=0.1)
    assert found.contradiction.startswith("neighbouring rows scatter by 0.189 um, and 1.50 um is declared")


def test_a_declaration_that_is_too_small_stays_for_neighbours_may_differ_by_more_than_noise() -> None:
    assert floor(noisy(400), None, np.full(3, 0.05), np.zeros(3)).source == "declared"


def test_the_last_resort_is_an_estimate_and_called_so() -> None:
    slow = np.linspace(0, 30, 1000)[:, None]
    found = floor(noisy(1000) + slow, None)
    assert found.source == "estimate"
    assert not found.known
    assert found.um == pytest.approx(0.2, rel=0.08)


def test_an_estimate_is_not_moved_by_gross_rows() -> None:
    values = noisy(1000)
    values[::25] += 1e3 * np.random.default_rng(6).normal(size=(40, 3))
    assert floor(values, None).um == pytest.approx(0.2, rel=0.1)


def test_rows_beyond_all_noise_are_found_and_others_are_not() -> None:
    values = noisy(5000)
    values[[17, 400, 401]] += [[0, 2, 0], [-3, 0, 0], [0, 0, 900]]
    assert np.flatnonzero(outlier_rows(values, everything(values))).tolist() == [17, 400, 401]


def test_what_a_repeat_confirms_is_not_gross() -> None:
    values = noisy(400)
    values[10:12, 0] += 5  # both rows of one visit
    values[21, 0] += 5  # one row of another
    assert np.flatnonzero(outlier_rows(values, everything(values), pairs(400))).tolist() == [21]


def test_a_gross_row_does_not_make_its_repeats_gross_nor_another_gross_row_right() -> None:
    values = noisy(600)
    visit = np.arange(600) // 3
    values[[30, 33, 34]] += [[4000.0, 0, 0], [900.0, 0, 0], [-700.0, 0, 0]]
    assert np.flatnonzero(outlier_rows(values, everything(values), visit)).tolist() == [30, 33, 34]


def test_one_repeat_does_not_vouch_for_itself() -> None:
    values = noisy(200)
    values[10, 1] = 60.0
    visit = np.where(np.arange(200) // 2 == 5, 5, -1)
    assert np.flatnonzero(outlier_rows(values, everything(values), visit)).tolist() == [10]


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
