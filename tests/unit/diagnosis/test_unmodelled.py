"""Unnamed disturbances widen the standard errors of a fit by what they could do to its parameters."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from compd.comparison import fit, initial_effect
from compd.diagnosis.candidates.candidates import Candidate, library_pool
from compd.diagnosis.criteria import Criteria
from compd.diagnosis.unmodelled import with_disturbances
from compd.units import UM_PER_MM
from tests.support.hidden_effects import LIBRARY, NOISE_UM, record_with_effects

SIGMA_UM = np.full(3, NOISE_UM)


def test_an_effect_of_the_same_form_adds_its_whole_rms(tmp_path: Path) -> None:
    aligned = record_with_effects(tmp_path / "run.csv", 1, {"link_elasticity": (1 / 30,)})
    effect = LIBRARY["link_elasticity"]
    result = fit(aligned, [initial_effect(effect, {}, aligned.rows.links)], SIGMA_UM)
    columns_um = aligned.columns(effect, {}) * UM_PER_MM
    twin = Candidate("twin", effect, columns_um, np.array([[0.0, 1.0]]), 0)
    criteria = Criteria(disturbance=0.3)
    wider = with_disturbances(result, aligned, SIGMA_UM, [twin], criteria)
    rms = float(np.sqrt(np.mean((columns_um[result.used] / SIGMA_UM[:, None]) ** 2)))
    added = wider.covariance[0, 0] - result.covariance[0, 0]
    assert np.sqrt(added) == pytest.approx(0.3 / rms, rel=1e-6)
    assert wider.fitted[0].covariance[0, 0] == wider.covariance[0, 0]
    assert np.array_equal(wider.fitted[0].theta, result.fitted[0].theta)


def test_more_disturbance_is_more_uncertainty_and_none_is_none(tmp_path: Path) -> None:
    aligned = record_with_effects(tmp_path / "run.csv", 1, {"link_elasticity": (1 / 30,)})
    result = fit(aligned, [initial_effect(LIBRARY["link_elasticity"], {}, aligned.rows.links)], SIGMA_UM)
    criteria = Criteria()
    pool = library_pool(aligned, list(LIBRARY.values()), ["link_elasticity"])

    def variance(disturbance: float) -> float:
        changed = replace(criteria, disturbance=disturbance)
        return float(with_disturbances(result, aligned, SIGMA_UM, pool.candidates, changed).covariance[0, 0])

    assert variance(0.0) == result.covariance[0, 0]
    assert variance(0.0) < variance(0.2) < variance(0.4)
    assert with_disturbances(result, aligned, SIGMA_UM, [], criteria) is result
