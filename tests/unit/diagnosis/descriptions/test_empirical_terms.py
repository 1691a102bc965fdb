"""Empirical terms: which covariates, forms and constants are tried, and the formulas that a person reads."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from compd.arrays import FloatArray
from compd.comparison import AlignedRecording
from compd.comparison.alignment.align_recording import align_recording
from compd.diagnosis.candidate_criteria import DescriptionCriteria
from compd.diagnosis.descriptions.empirical_terms import EmpiricalTerm, empirical_terms
from compd.diagnosis.descriptions.search_covariates import round_within, untried_quantities
from compd.diagnosis.descriptions.term_formula import formula_text
from compd.model.library import find_effect
from compd.recording import read_recording
from tests.support.external_recordings import record_external
from tests.support.hidden_effects import record_with_effects

ROWS = 200
RNG = np.random.default_rng(8)
PLACES_MM = RNG.uniform(-150, 150, ROWS)
WARM_degC = 23.4567 + np.cumsum(RNG.normal(0, 0.1, ROWS))
NOISE_UM = RNG.normal(0, 1, ROWS)


def residual_um(aligned: AlignedRecording) -> FloatArray:
    """(N, m) what the model leaves without any effect."""
    return (aligned.measured_mm - aligned.predicted_mm({})) * 1e3


def terms_of(aligned: AlignedRecording) -> dict[tuple[str, str], EmpiricalTerm]:
    """Every term at the reference by covariate and form."""
    terms = empirical_terms(aligned, residual_um(aligned))
    return {(term.covariate, term.form): term for term in terms if term.port == "reference"}


def forms_of(aligned: AlignedRecording, covariate: str) -> set[str]:
    return {form for name, form in terms_of(aligned) if name == covariate}


def test_only_what_warms_or_wets_arrives_late_and_only_along_a_way_something_repeats(tmp_path: Path) -> None:
    columns = {
        "slide_mm": PLACES_MM,
        "temperature_bed_degC": WARM_degC,
        "load_kg": np.abs(PLACES_MM),
        "moved_1": np.where(NOISE_UM > 0, 1.0, -1.0),
    }
    aligned = record_external(tmp_path / "run.csv", columns, {"x": NOISE_UM})
    assert forms_of(aligned, "slide_mm") == {"linear", "square", "periodic"}
    assert forms_of(aligned, "temperature_bed_degC") == {"linear", "square", "lagged"}
    assert forms_of(aligned, "load_kg") == {"linear", "square", "knee"}
    # the square of a direction is a constant
    assert forms_of(aligned, "moved_1") == {"linear"}


@pytest.mark.parametrize("rows", [6, 9, 17, 18, 40])
def test_few_evenly_spaced_rows_have_terms_with_ranges_that_are_not_empty(tmp_path: Path, rows: int) -> None:
    columns = {"slide_mm": 5.0 * np.arange(rows), "temperature_bed_degC": 20 + 0.1 * np.arange(rows) ** 1.5}
    aligned = record_external(tmp_path / "run.csv", columns, {"x": RNG.normal(0, 1, rows)})
    for term in empirical_terms(aligned, residual_um(aligned)):
        effect = term.effect()
        for constant in term.grid or (None,):
            assert np.isfinite(term.columns_um(aligned, effect, constant)).all()
            find_effect(term.declaration(term.axes[0], constant), "pasted")


def test_a_middle_is_a_round_number_and_zero_where_zero_is_near(tmp_path: Path) -> None:
    speed = np.where(np.arange(ROWS) % 2, 40.0, -40.0)
    speed[0] += 2e-13
    columns = {"speed_mm_per_s": speed, "temperature_bed_degC": WARM_degC}
    terms = terms_of(record_external(tmp_path / "run.csv", columns, {"x": NOISE_UM}))
    assert terms["speed_mm_per_s", "linear"].middle == 0.0
    middle = terms["temperature_bed_degC", "linear"].middle
    assert abs(middle - WARM_degC.mean()) < 0.05 * np.ptp(WARM_degC)
    assert len(f"{middle:g}") <= 4


@pytest.mark.parametrize(
    ("form", "covariate", "middle", "value", "formula"),
    [
        ("linear", "temperature_bed_degC", 70.0, None, "k * (temperature_bed_degC - 70) + c"),
        ("linear", "speed_mm_per_s", 0.0, None, "k * speed_mm_per_s + c"),
        ("square", "slide_mm", -12.5, None, "k * (slide_mm + 12.5) + k2 * (slide_mm + 12.5)**2 + c"),
        ("lagged", "humidity_pct", 50.0, 2400.0, "k * (lag(humidity_pct, 2400) - 50) + c"),
        ("lagged", "humidity_pct", 0.0, None, "k * lag(humidity_pct, tau) + c"),
        ("knee", "force_y_N", 0.0, -7.5, "k * force_y_N + m * maximum(force_y_N + 7.5, 0) + c"),
        ("knee", "force_y_N", 0.0, 0.0, "k * force_y_N + m * maximum(force_y_N, 0) + c"),
        ("step", "time_s", 0.0, 6000.0, "k * maximum(sign(time_s - 6000), 0) + c"),
        (
            "periodic",
            "slide_mm",
            0.0,
            1.37,
            "a * sin(2 * pi * slide_mm / 1.37) + b * cos(2 * pi * slide_mm / 1.37) + c",
        ),
        ("periodic", "turn_rad", 0.0, 2 * np.pi, "a * sin(turn_rad) + b * cos(turn_rad) + c"),
        ("periodic", "turn_rad", 0.0, np.pi, "a * sin(2 * turn_rad) + b * cos(2 * turn_rad) + c"),
    ],
)
def test_formulas_are_as_a_person_writes_them(
    form: str, covariate: str, middle: float, value: float | None, formula: str
) -> None:
    assert formula_text(form, covariate, middle, value, with_constant=True) == formula
    without = formula_text(form, covariate, middle, value, with_constant=False)
    assert without == formula.removesuffix(" + c")


def test_round_numbers() -> None:
    assert round_within(23.4567, 0.1) == 23.5
    assert round_within(5987.3, 50.0) == 6000.0
    assert round_within(-0.00731, 1e-4) == -0.0073


def test_an_angle_repeats_once_twice_and_three_times_per_turn_where_it_turns_far_enough(tmp_path: Path) -> None:
    azimuth_deg = RNG.uniform(0, 360, ROWS)
    columns = {"azimuth_deg": azimuth_deg, "tilt_rad": RNG.uniform(0, 0.35, ROWS), "swivel_deg": azimuth_deg / 30}
    aligned = record_external(tmp_path / "run.csv", columns, {"x": NOISE_UM + 5 * np.cos(np.radians(2 * azimuth_deg))})
    terms = terms_of(aligned)
    assert terms["azimuth_deg", "periodic"].grid[:3] == (360.0, 180.0, 120.0)
    # over 0.35 rad one turn and half a turn are parabolas, and over 12 degrees a third of one is
    assert terms["tilt_rad", "periodic"].grid[0] == pytest.approx(2 * np.pi / 3)
    assert 120.0 not in terms["swivel_deg", "periodic"].grid
    assert terms["azimuth_deg", "periodic"].refined_grid(180.0, 9) == [180.0]
    assert explained(aligned, terms["azimuth_deg", "periodic"], 180.0) > 0.9


def test_a_period_is_searched_along_a_way(tmp_path: Path) -> None:
    error_um = NOISE_UM + 4 * np.sin(2 * np.pi * PLACES_MM / 13.7 + 1.0) + 0.01 * PLACES_MM
    aligned = record_external(tmp_path / "run.csv", {"slide_mm": PLACES_MM}, {"x": error_um, "y": NOISE_UM[::-1]})
    term = terms_of(aligned)["slide_mm", "periodic"]
    best = min(term.grid, key=lambda period: abs(period - 13.7))
    assert best == pytest.approx(13.7, abs=0.1)
    refined = max(term.refined_grid(best, 9), key=lambda period: explained(aligned, term, period))
    assert refined == pytest.approx(13.7, abs=0.05)


def test_labels_and_derivatives_are_no_covariates_and_are_told(tmp_path: Path) -> None:
    columns = {
        "star_1": RNG.integers(1, 60, ROWS).astype(float),
        "frames_1": np.repeat(np.arange(ROWS // 2), 2).astype(float),
        "d_radius_x_mm": PLACES_MM / 100,
        "lamp_1": (np.arange(ROWS) > 90).astype(float),
        "turns_1": np.round(PLACES_MM),
        "room_degC": np.full(ROWS, 20.0),
        "wind_m_per_s": np.where(np.arange(ROWS) % 4 == 0, np.nan, PLACES_MM),
        "slide_mm": PLACES_MM,
    }
    aligned = record_external(tmp_path / "run.csv", columns, {"x": NOISE_UM})
    tried = {covariate for covariate, _ in terms_of(aligned)}
    assert tried == {"lamp_1", "turns_1", "slide_mm", "time_s"}
    assert untried_quantities(aligned, DescriptionCriteria(), ()) == {
        "star_1": "only counts or names rows",
        "frames_1": "only counts or names rows",
        "d_radius_x_mm": "a derivative of the model's prediction, which belongs to an effect",
        "room_degC": "stayed the same",
        "wind_m_per_s": "empty in 25 % of the rows",
    }


def test_an_empty_cell_costs_no_covariate_and_no_row(tmp_path: Path) -> None:
    whole = record_external(tmp_path / "whole.csv", {"temperature_bed_degC": WARM_degC}, {"x": NOISE_UM})
    gappy_degC = np.where(np.isin(np.arange(ROWS), [0, 77, 78, 79]), np.nan, WARM_degC)
    gappy = record_external(tmp_path / "gappy.csv", {"temperature_bed_degC": gappy_degC}, {"x": NOISE_UM})
    assert set(terms_of(gappy)) == set(terms_of(whole))
    term = terms_of(gappy)["temperature_bed_degC", "linear"]
    columns_um = term.columns_um(gappy, term.effect(), None)
    assert np.isfinite(columns_um).all()
    np.testing.assert_allclose(columns_um, term.columns_um(whole, term.effect(), None), atol=1.0)


def test_a_formula_has_a_constant_only_where_no_constant_is_fitted_along(tmp_path: Path) -> None:
    known = record_with_effects(tmp_path / "known.csv", 1, {})
    assert terms_of(known)["humidity_pct", "linear"].declaration("x")["formula"].endswith("+ c")
    error_um = {"x": NOISE_UM, "y": NOISE_UM[::-1]}
    external = record_external(tmp_path / "run.csv", {"slide_mm": PLACES_MM}, error_um, frame="instrument")
    term = terms_of(external)["slide_mm", "linear"]
    assert term.declaration("x")["formula"] == "k * slide_mm"
    assert term.columns_um(external, term.effect(), None).shape == (ROWS, 2, 2)


def test_ids_say_where_and_what(tmp_path: Path) -> None:
    columns = {"temperature_bed_degC": WARM_degC}
    aligned = record_external(tmp_path / "run.csv", columns, {"x": NOISE_UM, "z": NOISE_UM})
    terms = terms_of(aligned)
    assert terms["temperature_bed_degC", "linear"].declaration("z")["id"] == "z_follows_temperature_bed"
    assert terms["temperature_bed_degC", "lagged"].declaration("x", 700.0)["id"] == "x_follows_temperature_bed_lagged"


def test_a_lag_is_in_seconds_and_a_knee_in_the_unit_of_its_covariate(tmp_path: Path) -> None:
    columns = {"temperature_bed_degC": WARM_degC, "load_kg": np.linspace(0.0, 5.0, ROWS)}
    terms = terms_of(record_external(tmp_path / "run.csv", columns, {"x": NOISE_UM}))
    assert terms["temperature_bed_degC", "lagged"].constant_unit == "s"
    assert terms["load_kg", "knee"].constant_unit == "kg"


def explained(aligned: AlignedRecording, term: EmpiricalTerm, constant: float) -> float:
    """Share of the residual's variation that a term explains at a value of its constant."""
    y: FloatArray = residual_um(aligned)
    y = (y - y.mean(axis=0)).ravel()
    columns = term.columns_um(aligned, term.effect(), constant)
    A = np.concatenate([columns, np.ones_like(columns[:, :, :1])], axis=2).reshape(len(y), -1)
    rest = y - A @ np.linalg.lstsq(A, y, rcond=None)[0]
    return float(1 - rest @ rest / (y @ y))


def test_without_times_nothing_drifts_lags_swings_or_happens(tmp_path: Path) -> None:
    record_external(tmp_path / "run.csv", {"temperature_bed_degC": WARM_degC}, {"x": NOISE_UM})
    lines = (tmp_path / "run.csv").read_text(encoding="utf-8").splitlines()
    (tmp_path / "run.csv").write_text("\n".join(line.partition(",")[2] for line in lines) + "\n", encoding="utf-8")
    aligned = align_recording(read_recording(tmp_path / "run.csv", None), None)
    assert forms_of(aligned, "temperature_bed_degC") == {"linear", "square"}
    assert not forms_of(aligned, "time_s")
