"""Sessions that begin warm: states that nobody knows are fitted along, and no parameter pays for them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from compd.arrays import FloatArray
from compd.comparison.alignment.aligned_recording import AlignedRecording
from compd.comparison.effect_fit import fit, initial_effect
from compd.comparison.nuisance import initial_state_columns
from compd.comparison.recording_comparison import compare
from compd.comparison.shape_search import search_constants
from compd.model.library import find_effect
from tests.support.external_recordings import record_external
from tests.support.hidden_effects import LIBRARY, NOISE_UM, record_with_effects

LAG = LIBRARY["link_expansion_lag"]
TAU_S, COEFFICIENT = 900.0, 2.0
SIGMA_UM = np.full(3, NOISE_UM)


def decay(aligned: AlignedRecording, tau_s: float) -> tuple[FloatArray, FloatArray]:
    """(N,) what is left of the start of each row's session, and (N,) the session's number from 0."""
    session = np.cumsum(aligned.rows.session_start) - 1
    start_s = aligned.rows.time_s[aligned.rows.session_start][session]
    return np.exp(-(aligned.rows.time_s - start_s) / tau_s), session


def record_warm(path: Path, seed: int, missing_K: float) -> AlignedRecording:
    """A recording with link_expansion_lag whose rods begin each session about `missing_K` below their skin."""
    still = record_with_effects(path / f"still-{seed}.csv", seed, {})
    left, session = decay(still, TAU_S)
    start_K = missing_K * np.random.default_rng([seed, 7]).uniform(0.5, 1.5, (session.max() + 1, 3))
    shorter_mm = COEFFICIENT * 1e-6 * still.rows.link_mm * start_K[session] * left[:, None]
    by_link = still.sensitivity(["link"])["link"].tip
    tip_um = -1e3 * (by_link @ shorter_mm[:, :, None])[:, :, 0]
    return record_with_effects(path / f"warm-{seed}.csv", seed, {"link_expansion_lag": (COEFFICIENT,)}, extra_um=tip_um)


def test_a_state_moves_its_link_in_its_session_and_fades(tmp_path: Path) -> None:
    aligned = record_with_effects(tmp_path / "run.csv", 1, {})
    columns_um = initial_state_columns(aligned, LAG, {"tau": TAU_S})
    left, session = decay(aligned, TAU_S)
    by_link = aligned.sensitivity(["link"])["link"].tip * (1e-3 * aligned.rows.link_mm * left[:, None])[:, None, :]
    assert columns_um.shape == (len(left), 3, 12)
    for k in range(4):
        own = columns_um[:, :, 3 * k : 3 * k + 3]
        np.testing.assert_allclose(own[session == k], by_link[session == k], atol=1e-12)
        assert not own[session != k].any()


@pytest.mark.parametrize(
    ("port", "formula", "per", "states"),
    [
        ("reference", "k * (lag(temperature_room_degC, 700) - 20)", "machine", 1),
        ("link", "k * lag(temperature_room_degC, 700) + c", "machine", 1),
        ("link", "k * lag(temperature_link, 700) * link_mm", "machine", 3),
        # each link may have another coefficient, and so another product with the state
        ("link", "k * lag(temperature_room_degC, 700)", "link", 3),
        ("link", "k * (lag(temperature_link, 700) - lag(temperature_room_degC, 200))", "machine", 4),
        ("link", "k * temperature_link", "machine", 0),
    ],
)
def test_formulas_have_a_state_for_each_lag_of_a_quantity(
    tmp_path: Path, port: str, formula: str, per: str, states: int
) -> None:
    aligned = record_with_effects(tmp_path / "run.csv", 1, {})
    number: dict[str, Any] = {"unit": "um/K", "plausible": [-9, 9], "source": "test"}
    parameters = {"k": {**number, "per": per}} | ({"c": number} if "+ c" in formula else {})
    declaration = {"id": "x", "port": port, "formula": formula, "parameters": parameters}
    effect = find_effect(declaration | ({"axis": "z"} if port == "reference" else {}), "test")
    assert initial_state_columns(aligned, effect, {}).shape[2] == 4 * states


def test_a_session_begins_with_the_first_row_in_which_the_effect_is_known(tmp_path: Path) -> None:
    warm_degC = 20 + np.linspace(0, 5, 60)
    gappy_degC = np.where(np.arange(60) < 2, np.nan, warm_degC)
    effect = find_effect(
        {
            "id": "bed",
            "port": "reference",
            "axis": "x",
            "formula": "k * lag(temperature_bed_degC, 600)",
            "parameters": {"k": {"unit": "um/K", "plausible": [-9, 9], "source": "test"}},
        },
        "test",
    )
    aligned = record_external(tmp_path / "run.csv", {"temperature_bed_degC": gappy_degC}, {"x": np.zeros(60)})
    column = initial_state_columns(aligned, effect, {})[:, 0, 0]
    np.testing.assert_allclose(column[2:], np.exp(-10 * np.arange(58) / 600))
    assert not column[:2].any()


@pytest.mark.parametrize("missing_K", [0.0, 3.0])
def test_a_recording_that_begins_warm_gives_the_same_numbers_and_ends_at_the_floor(
    tmp_path: Path, missing_K: float
) -> None:
    aligned = record_warm(tmp_path, 1, missing_K)
    result = search_constants(aligned, (), LAG, SIGMA_UM)
    (fitted,) = result.fitted
    assert fitted.constants["tau"] == pytest.approx(TAU_S, rel=0.1)
    assert abs(fitted.theta[0] - COEFFICIENT) < 4 * np.sqrt(result.covariance[0, 0])
    assert (result.rms_um / NOISE_UM) ** 2 < 1.1
    # on another day the rods begin elsewhere again
    other = record_warm(tmp_path, 2, -missing_K)
    assert compare(other).floor_ratio > 30
    assert compare(other, result.fitted).floor_ratio < 1.1


def test_without_an_effect_nothing_is_fitted_along(tmp_path: Path) -> None:
    """What a session begins with is no excuse for a model that has no lag."""
    aligned = record_warm(tmp_path, 1, 3.0)
    residual_um = (aligned.measured_mm - aligned.predicted_mm({})) * 1e3
    comparison = compare(aligned)
    np.testing.assert_allclose(comparison.residual_um, residual_um)
    assert initial_state_columns(aligned, LIBRARY["link_expansion"], {}).shape[2] == 0


def test_the_constant_of_an_external_model_holds_no_initial_state(tmp_path: Path) -> None:
    time_s = 60.0 * np.arange(300)
    bed_degC = 60 + 20 * np.sin(time_s / 2000.0)
    effect = find_effect(
        {
            "id": "bed",
            "port": "reference",
            "axis": "x",
            "formula": "k * (lag(bed_degC, 1500) - 60)",
            "parameters": {"k": {"unit": "um/K", "plausible": [-9, 9], "source": "test"}},
        },
        "test",
    )
    columns = {"time_s": time_s, "bed_degC": bed_degC}
    still = record_external(tmp_path / "still.csv", columns, {"x": np.zeros(300)})
    lagged_um = still.columns(effect, {})[:, 0, 0] * 1e3
    error_um = 7.0 + 0.5 * lagged_um + 40 * np.exp(-time_s / 1500.0)
    aligned = record_external(tmp_path / "run.csv", columns, {"x": error_um}, sigma_um=1.0)
    result = fit(aligned, [initial_effect(effect, {}, 0)])
    assert result.fitted[0].theta[0] == pytest.approx(0.5, abs=0.03)
    comparison = compare(aligned, result.fitted)
    assert comparison.rms_um == pytest.approx(1.0, abs=0.1)
    assert comparison.constant_um[0] == pytest.approx(7.0, abs=0.5)
