"""Fixed balls and pins: found from the prediction, linearised rightly, and refused where they cannot be known."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from compd.comparison.alignment.align_recording import align_recording
from compd.comparison.alignment.aligned_recording import effect_deltas
from compd.comparison.alignment.fixed_ends import FixedEnds, place_balls, place_pins
from compd.comparison.effect_fit import fit, initial_effect
from compd.comparison.recording_comparison import compare
from compd.errors import CompdError, RecordingError
from compd.model.library import find_effect
from compd.planning import plan_measurement, recorded_limits
from compd.recording import read_recording, write_recording
from tests.support.fixed_end_recordings import DISTANCE, PINS, recorded
from tests.support.measured import SIGMA_UM, Floats, aligned, hidden

BALL_MM = np.array([20.0, -30.0, 40.0])


def around(count: int, seed: int = 1, radius_mm: float = 100.0) -> Floats:
    """(count, 3) places on a sphere about BALL_MM, a millimetre in and out."""
    rng = np.random.default_rng(seed)
    away = rng.standard_normal((count, 3))
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    return BALL_MM + away * (radius_mm + rng.uniform(-1, 1, (count, 1)))


def found(tip_mm: Floats, distance_mm: Floats, *, absolute: bool = False) -> FixedEnds:
    end = np.zeros(len(tip_mm), dtype=np.int64)
    return place_balls(tip_mm, distance_mm, end, absolute, lambda number: f"ball {number}", "run.csv")


@pytest.mark.parametrize("absolute", [False, True])
@pytest.mark.parametrize("varies", [False, True])
def test_a_ball_is_found_with_the_constant_of_the_length(absolute: bool, varies: bool) -> None:
    tip_mm = around(40)
    if not varies:
        away = tip_mm - BALL_MM
        tip_mm = BALL_MM + 14.5 * away / np.linalg.norm(away, axis=1, keepdims=True)
    constant_mm = 0.0 if absolute else 0.037
    ends = found(tip_mm, np.linalg.norm(tip_mm - BALL_MM, axis=1) - constant_mm, absolute=absolute)
    assert ends.place_mm[0] == pytest.approx(BALL_MM, abs=1e-6)
    assert ends.added_mm[0] == pytest.approx(constant_mm, abs=1e-6)
    assert ends.parameters == (3 if absolute else 4)


def test_a_cut_beam_moves_no_ball() -> None:
    tip_mm = around(60)
    distance_mm = np.linalg.norm(tip_mm - BALL_MM, axis=1)
    distance_mm[[7, 31]] += 0.5
    assert found(tip_mm, distance_mm).place_mm[0] == pytest.approx(BALL_MM, abs=0.01)


def test_a_circle_through_the_ball_is_enough_in_its_plane() -> None:
    angle = np.linspace(0, 2 * np.pi, 36, endpoint=False)
    tip_mm = BALL_MM + 100 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    ends = found(tip_mm, np.full(36, 99.98))
    assert ends.place_mm[0] == pytest.approx(BALL_MM, abs=1e-6)
    assert ends.added_mm[0] == pytest.approx(0.02, abs=1e-6)


def test_a_ball_beside_the_plane_of_its_rows_is_refused() -> None:
    angle = np.linspace(0, 2 * np.pi, 36, endpoint=False)
    tip_mm = BALL_MM + np.column_stack([80 * np.cos(angle), 80 * np.sin(angle), 60 + 0 * angle])
    with pytest.raises(RecordingError, match="ball 0 lie in one plane, so that it may be on either side"):
        found(tip_mm, np.full(36, 100.0), absolute=True)


def test_too_few_rows_are_refused_by_the_balls_name() -> None:
    tip_mm = around(4)
    with pytest.raises(RecordingError, match="ball 0 has 4 rows, and 4 numbers are fitted"):
        found(tip_mm, np.linalg.norm(tip_mm - BALL_MM, axis=1))


def test_pins_are_at_the_middle_of_their_rows() -> None:
    tip_mm = np.array([[1.0, 2, 3], [1.1, 2, 3], [1.2, 2, 9], [5, 5, 5], [np.nan, 0, 0]])
    ends = place_pins(tip_mm, np.array([4, 4, 4, 9, 9]), lambda number: f"pin {number}", "run.csv")
    assert ends.name == ("pin 4", "pin 9")
    assert ends.place_mm == pytest.approx(np.array([[1.1, 2, 3], [5, 5, 5]]))
    assert ends.of_row.tolist() == [0, 0, 0, 1, 1]


@pytest.mark.parametrize("absolute", [False, True])
def test_columns_are_the_derivatives_of_the_lengths(absolute: bool) -> None:
    tip_mm = around(20)
    of_row = np.arange(20) % 2
    places_mm = np.array([BALL_MM, BALL_MM + np.array([5.0, 6.0, 7.0])])
    ends = FixedEnds(("a", "b"), np.arange(2), places_mm, np.zeros(2), of_row, True, absolute)
    columns = ends.columns(tip_mm)
    assert columns.shape == (20, 1, ends.parameters)
    step_mm = 1e-4
    for k in range(6):
        moved = [places_mm.copy(), places_mm.copy()]
        for sign, place in zip((1, -1), moved, strict=True):
            place[k // 3, k % 3] += sign * step_mm
        further, nearer = (
            FixedEnds(("a", "b"), np.arange(2), place, np.zeros(2), of_row, True, absolute).lengths_mm(tip_mm)
            for place in moved
        )
        assert columns[:, :, k] == pytest.approx((further - nearer) / (2 * step_mm), abs=1e-8)
    if not absolute:
        assert columns[:, 0, 6] == pytest.approx(1.0 - of_row)


def test_lengths_from_two_balls_reach_the_floor(tmp_path: Path) -> None:
    comparison = compare(aligned(recorded(tmp_path, DISTANCE)))
    assert comparison.aligned.labels == ("distance",)
    assert comparison.rms_um == pytest.approx(SIGMA_UM, rel=0.12)
    assert comparison.at_floor
    registration = comparison.as_json()["registration"]
    assert registration["parameters"] == 8
    assert registration["places_mm"]["ball 1"] == pytest.approx([150.0, 40.0, 20.0], abs=0.01)
    assert comparison.attitude_residual_urad is None
    assert comparison.link_residual_um is None


def test_the_derivative_of_a_length_is_along_the_line_from_its_ball(tmp_path: Path) -> None:
    recording = aligned(recorded(tmp_path, DISTANCE))
    effect = hidden("link_elasticity", 50.0)
    _, added = effect_deltas([effect], recording.rows)
    small = {port: 1e-2 * values for port, values in added.items()}
    difference = (recording.predicted_mm(small) - recording.predicted_mm({})) / 1e-2
    columns = recording.columns(effect.effect, effect.constants) @ effect.theta
    assert columns == pytest.approx(difference, abs=1e-7)
    assert np.abs(columns).max() > 1e-4


@pytest.mark.parametrize("reference", [DISTANCE, PINS])
def test_an_effect_is_fitted_through_unknown_places(tmp_path: Path, reference: dict[str, Any]) -> None:
    path = recorded(tmp_path, reference, (hidden("link_elasticity", 20.0),))
    recording = aligned(path)
    assert not compare(recording).at_floor
    effect = initial_effect(hidden("link_elasticity", 20.0).effect, {}, 3)
    result = fit(recording, [effect])
    column = effect.effect.columns(3)[0]
    value, _ = column.parameter.from_theta(float(result.fitted[0].theta[0]))
    assert value == pytest.approx(20.0, rel=0.03)
    assert compare(recording, result.fitted).rms_um == pytest.approx(SIGMA_UM, rel=0.2)


def test_a_scale_that_is_wrong_everywhere_does_nothing_at_a_pin(tmp_path: Path) -> None:
    recording = aligned(recorded(tmp_path, PINS))
    columns = recording.columns(hidden("scale_gain", 0.0, 0.0, 0.0).effect, {})[recording.usable.mask]
    pins = recording.registration_columns[recording.usable.mask]
    flat, known = columns.reshape(-1, columns.shape[2]), pins.reshape(-1, pins.shape[2])
    left = flat - known @ np.linalg.lstsq(known, flat, rcond=None)[0]
    assert np.linalg.norm(left) < 1e-3 * np.linalg.norm(flat)


def test_rows_all_over_the_workspace_are_not_planned_for_a_bar(tmp_path: Path) -> None:
    recording = aligned(recorded(tmp_path, DISTANCE))
    rivals = [hidden("link_elasticity", 20.0), hidden("tool_expansion", 10.0)]
    with pytest.raises(CompdError, match="measures only within the length of the bar"):
        plan_measurement(recording, (), rivals, np.array([SIGMA_UM]), recorded_limits(recording), 10)


def test_an_external_models_tip_is_compared_with_lengths(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    model_mm = rng.uniform(-100, 100, (80, 3))
    true_mm = model_mm + np.column_stack([60e-6 * model_mm[:, 1], np.zeros(80), np.zeros(80)])
    ball = np.arange(80) % 3
    balls_mm = np.array([[200.0, 0, 0], [0, 220, 50], [-150, -150, 120]])
    distance_mm = np.linalg.norm(true_mm - balls_mm[ball], axis=1) + rng.normal(0, 0.0005, 80)
    columns = {
        "time_s": np.arange(80.0),
        "ball": 1.0 + ball,
        "reference_distance_mm": distance_mm,
        **{f"model_{axis}_mm": model_mm[:, k] for k, axis in enumerate("xyz")},
    }
    path = tmp_path / "own.csv"
    reference = {"quantity": "distance", "absolute": True, "sigma_um": 0.5}
    write_recording(path, columns, {"machine": "external", "reference": reference})
    recording = align_recording(read_recording(path), None)
    assert compare(recording).rms_um > 1.0
    squareness = find_effect(
        {
            "id": "squareness",
            "port": "reference",
            "axis": "x",
            "formula": "q * tip_y_mm / 1000",
            "physics": "The axes are not square.",
            "parameters": {"q": {"unit": "urad", "plausible": [-500, 500], "source": "assembly"}},
        },
        "test",
    )
    result = fit(recording, [initial_effect(squareness, {}, 0)])
    parameter = squareness.columns(0)[0].parameter
    std = float(np.sqrt(result.covariance[0, 0]))
    value, std = parameter.from_theta(float(result.fitted[0].theta[0]), std)
    assert std < 5.0
    assert value == pytest.approx(60.0, abs=3 * std)
    assert compare(recording, result.fitted).rms_um == pytest.approx(0.5, rel=0.25)
