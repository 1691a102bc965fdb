"""The problem of a diagnosis: which rows count and how much, in which unit, beside which columns."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from compd.comparison import AlignedRecording, compare, fit, initial_effect
from compd.diagnosis.candidates.candidates import CandidatePool, library_pool
from compd.diagnosis.criteria import Criteria
from compd.diagnosis.search.problem import DiagnosisProblem, build_problem
from tests.support.external_recordings import SIGMA_UM, along, record_external
from tests.support.hidden_effects import LIBRARY, record_with_effects

ROWS = 200
CRITERIA = Criteria()
PLAY = along("x", "play", "k * moved_1")
OFFSET = along("x", "offset", "k")


def stage(path: Path, error_um: np.ndarray | float = 0.0, **options: Any) -> AlignedRecording:
    """A stage with play of 3 um."""
    moved = np.random.default_rng(1).choice([-1.0, 1.0], ROWS)
    columns = {"moved_1": moved, **options.pop("columns", {})}
    return record_external(path, columns, {"x": 3 * moved + error_um}, **options)


def problem(aligned: AlignedRecording, *effects: Any) -> DiagnosisProblem:
    return build_problem(compare(aligned), library_pool(aligned, effects, ()), CRITERIA)


def test_the_residual_counts_in_standard_deviations_of_the_noise(tmp_path: Path) -> None:
    aligned = stage(tmp_path / "run.csv", sigma_um=0.1, declared_um=0.1)
    built = problem(aligned, PLAY)
    assert built.floor_known
    assert built.unit_um == pytest.approx(0.1)
    assert built.losses(built.candidates).loss((0,)) == pytest.approx(1.0, abs=0.25)
    whitened = built.whiten(built.candidates[0].columns_um)
    np.testing.assert_allclose(
        np.abs(whitened[:, 0, 0]), 10.0 * np.abs(aligned.rows.quantities["moved_1"]) * built.root_weight
    )


def test_without_a_known_noise_the_residuals_own_size_is_the_unit(tmp_path: Path) -> None:
    built = problem(stage(tmp_path / "run.csv", declared_um=None), PLAY)
    assert not built.floor_known
    assert built.unit_um == pytest.approx(3.0, rel=0.1)
    assert built.losses(built.candidates).log_loss(0.01) == pytest.approx(np.log(0.01))


def test_gross_rows_do_not_count_and_rows_with_empty_cells_are_not_known(tmp_path: Path) -> None:
    error_um = np.zeros(ROWS)
    error_um[[20, 90]] = 50.0, -70.0
    moved = np.random.default_rng(1).choice([-1.0, 1.0], ROWS)
    moved[150] = np.nan
    built = problem(stage(tmp_path / "run.csv", error_um=error_um, columns={"moved_1": moved}), PLAY)
    assert np.flatnonzero(built.gross).tolist() == [20, 90]
    assert np.flatnonzero(~built.known).tolist() == [150]
    assert np.flatnonzero(~built.rows).tolist() == [20, 90, 150]
    assert len(built.data.y) == ROWS - 3
    assert all(np.array_equal(np.unique(fold), np.arange(fold.max() + 1)) for fold in built.data.splits)
    assert np.array_equal(np.unique(built.data.block), np.arange(built.data.block.max() + 1))


def test_what_a_candidate_explains_makes_no_row_gross(tmp_path: Path) -> None:
    """A bump of a hundred times the noise in five rows is an effect, if there is one."""
    bump = np.zeros(ROWS)
    bump[[5, 50, 100, 120, 190]] = 1.0
    aligned = stage(tmp_path / "run.csv", error_um=50 * bump, columns={"bump_1": bump})
    assert problem(aligned, PLAY).gross.sum() == 0, "every measured quantity may explain a row"
    built = problem(aligned, PLAY, along("x", "bump", "k * bump_1"))
    assert built.gross.sum() == 0
    assert built.weigh_beside([]).gross.sum() == 5
    assert built.weigh_beside(built.candidates).gross.sum() == 0


def test_the_constant_competes_on_a_known_machine_and_is_fitted_along_on_another(tmp_path: Path) -> None:
    tripod = problem(record_with_effects(tmp_path / "tripod.csv", 1, {}, visits=40), LIBRARY["backlash"])
    assert [candidate.kind for candidate in tripod.candidates] == ["effect", "constant"]
    assert tripod.nuisance.shape[2] == 0
    external = problem(stage(tmp_path / "run.csv"), PLAY, OFFSET)
    assert [candidate.name for candidate in external.candidates] == ["play"]
    assert [candidate.name for candidate in external.same_as_nuisance] == ["offset"]
    assert external.nuisance.shape[2] == 1


def test_parameters_of_the_models_own_effects_are_fitted_along(tmp_path: Path) -> None:
    aligned = stage(tmp_path / "run.csv")
    (right,) = fit(aligned, [initial_effect(PLAY, {}, aligned.rows.links)]).fitted
    half = replace(right, theta=right.theta / 2)
    built = build_problem(compare(aligned, [half]), CandidatePool(()), CRITERIA)
    assert built.nuisance.shape[2] == 2
    assert built.losses(()).baseline == pytest.approx(1.0, abs=0.2)


def test_given_weights_are_used_and_found_again_beside_the_members(tmp_path: Path) -> None:
    error_um = np.zeros(ROWS)
    error_um[20] = 50.0
    aligned = stage(tmp_path / "run.csv", error_um=error_um)
    built = problem(aligned, PLAY)
    weights = built.weigh_beside(built.candidates)
    again = build_problem(built.comparison, built.pool, CRITERIA, weights)
    assert np.array_equal(again.gross, weights.gross)
    np.testing.assert_allclose(again.root_weight**2, weights.weight[again.rows])
    assert again.sigma_um == pytest.approx([SIGMA_UM])


def test_of_a_floor_from_few_repeats_chance_makes_a_larger_loss(tmp_path: Path) -> None:
    moved, none = np.random.default_rng(1).choice([-1.0, 1.0], ROWS), {"x": np.zeros(ROWS)}
    repeated = {"moved_1": moved, "visit": np.where(np.arange(ROWS) < 40, np.arange(ROWS) // 2, np.nan)}
    few = problem(record_external(tmp_path / "few.csv", repeated, none, declared_um=None), PLAY)
    assert few.comparison.floor.dof == pytest.approx(0.885 * 20, rel=0.1)
    assert few.may_be_noise(1.5)
    assert not few.is_at_floor(1.5)
    assert not few.may_be_noise(3.0)
    assert not problem(record_external(tmp_path / "declared.csv", repeated, none), PLAY).may_be_noise(1.5)
    unknown = record_external(tmp_path / "unknown.csv", {"moved_1": moved}, none, declared_um=None)
    assert not problem(unknown, PLAY).may_be_noise(0.5)
