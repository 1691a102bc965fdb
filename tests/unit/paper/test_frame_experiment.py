"""Equations (4) and (5) beside the exact frame: the difference is the second-order term, and is told with its size."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

import frame_experiment
import frame_page
import frame_picture
from compd.arrays import FloatArray
from compd.configuration import Configuration, load, shipped_configuration
from compd.gauge import DataSheetNoise
from compd.machine_builder import build_model
from compd.model import MachineModel
from compd.model.kinematics import FrameGeometry, solve_frame
from compd.simulation import Strengths
from frame_experiment import SIZES_MM, FrameResult

# The ends of t1..t3, u1..u6 by equation (3) of the paper, counted from 0: supports 0..2, then plate points 3..5.
ENDS = np.array([(0, 1), (1, 2), (2, 0), (0, 3), (0, 5), (1, 3), (1, 4), (2, 4), (2, 5)])


@pytest.fixture(scope="module", params=["tripod-cmm.yaml", "hexapod.yaml"])
def configuration(request: pytest.FixtureRequest) -> Configuration:
    return load(shipped_configuration(request.param))


@pytest.fixture(scope="module")
def result(configuration: Configuration) -> FrameResult:
    return frame_experiment.run_frame_experiment(configuration, 3)


def second_order_supports_mm(geometry: FrameGeometry, changes_mm: FloatArray) -> FloatArray:
    """What equation (5) leaves out, to leading order, (N, 3, 3): written anew here, with nothing of the model's code.

    A distance of length L whose ends move by v against each other grows by e.v + (|v|^2 - (e.v)^2) / (2 L). So the
    supports that have the wanted distances are J^-1 (U - q), with q the second term at J^-1 U.
    """
    points = np.concatenate([geometry.zero_supports_M_mm, geometry.plate_points_M_mm])
    span = points[ENDS[:, 0]] - points[ENDS[:, 1]]
    length = np.linalg.norm(span, axis=1)
    along = span / length[:, None]
    J = np.zeros((9, 6, 3))
    J[np.arange(9), ENDS[:, 0]] = along
    J[np.arange(9), ENDS[:, 1]] = -along
    inverse = np.linalg.inv(J[:, :3].reshape(9, 9))
    moved = np.zeros((len(changes_mm), 6, 3))
    moved[:, :3] = (changes_mm @ inverse.T).reshape(-1, 3, 3)
    apart = moved[:, ENDS[:, 0]] - moved[:, ENDS[:, 1]]
    stretch = ((apart**2).sum(-1) - (apart * along).sum(-1) ** 2) / (2 * length)
    return np.asarray((-stretch @ inverse.T).reshape(-1, 3, 3))


def model_of(configuration: Configuration) -> MachineModel:
    return build_model(configuration.geometry, configuration.wiring)


def test_the_difference_is_the_second_order_term_by_another_formula(configuration: Configuration) -> None:
    model = model_of(configuration)
    changes_mm = np.random.default_rng(5).uniform(-0.1, 0.1, (40, 9))
    by_formula_mm = np.linalg.norm(second_order_supports_mm(model.frame, changes_mm).mean(axis=1), axis=1)
    difference = frame_experiment.difference(model, changes_mm)
    assert by_formula_mm.min() > 1e-6
    # what is left is of third order: a change over a length, 0.1 mm over 500 mm, amplified a few times
    np.testing.assert_allclose(difference.displacement_mm, by_formula_mm, rtol=0.02)


@pytest.mark.long
def test_the_slope_is_two_and_is_fitted(result: FrameResult) -> None:
    assert frame_experiment.order(result) == pytest.approx(2.0, abs=0.02)
    first_order = result.by_size._replace(tip_mm=1e-3 * SIZES_MM[:, None] * np.ones(4))
    assert frame_experiment.order(replace(result, by_size=first_order)) == pytest.approx(1.0)


@pytest.mark.long
def test_at_the_crossing_the_difference_is_the_noise(configuration: Configuration, result: FrameResult) -> None:
    directions = np.random.default_rng([3, 45]).normal(size=(frame_experiment.DIRECTIONS, 9))
    directions /= np.abs(directions).max(axis=1, keepdims=True)
    at = frame_experiment.difference(model_of(configuration), frame_experiment.crossing_mm(result) * directions)
    assert at.tip_mm.max() * 1e3 == pytest.approx(result.noise_um, rel=0.05)


def test_noise_of_the_tip_is_that_of_random_readings(configuration: Configuration, result: FrameResult) -> None:
    """Drawn instead of differentiated: each gauge reads with its noise, the exact frame carries it to the tip."""
    model = model_of(configuration)
    noise_mm, source = frame_experiment.frame_noise_mm(configuration)
    assert source == "declared in the configuration"
    drawn_mm = np.random.default_rng(6).normal(size=(4000, 9)) * noise_mm
    supports = solve_frame(model.frame, model.zero.distances_mm + drawn_mm)
    tips_mm = frame_experiment._tip_mm(model, supports.base_joints_M_mm)
    assert np.linalg.norm(tips_mm.std(axis=0)) * 1e3 == pytest.approx(result.noise_um, rel=0.05)


def test_a_declared_noise_is_taken_once_every_frame_gauge_has_one(configuration: Configuration) -> None:
    def with_noise(names: set[str]) -> Configuration:
        gauges = {
            name: gauge.model_copy(update={"noise_um": 0.3 if name in names else None})
            for name, gauge in configuration.gauges.items()
        }
        return replace(configuration, gauges=gauges)

    names = {wire.gauge.split(".")[0] for wire in configuration.wiring.frame}
    noise_mm, source = frame_experiment.frame_noise_mm(with_noise(names))
    assert noise_mm.tolist() == pytest.approx([3e-4] * 9)
    assert source == "declared in the configuration"
    if len(names) > 1:
        some_mm, source = frame_experiment.frame_noise_mm(with_noise(names - {min(names)}))
        assert some_mm.tolist() == pytest.approx([Strengths().comparator_noise_um / 1e3] * 9)
        assert "as simulated" in source


def test_the_noise_of_data_sheets_counts_as_what_is_declared(
    configuration: Configuration, monkeypatch: pytest.MonkeyPatch
) -> None:
    gauges = {name: gauge.model_copy(update={"noise_um": None}) for name, gauge in configuration.gauges.items()}
    for wire in configuration.wiring.frame:
        driver = configuration.drivers[wire.gauge.split(".")[0]]
        monkeypatch.setattr(driver, "noise", DataSheetNoise(0.4, "page 5"))
    noise_mm, source = frame_experiment.frame_noise_mm(replace(configuration, gauges=gauges))
    assert noise_mm.tolist() == pytest.approx([4e-4] * 9)
    assert source == "declared in the configuration or by the driver"


def test_a_warm_up_is_far_below_the_noise(result: FrameResult) -> None:
    assert len(result.time_h) == 61
    assert 0.01 < np.abs(result.warm_up_change_mm).max() < 0.1
    assert 0 < result.warm_up.tip_mm.max() * 1e3 < 0.05 * result.noise_um


@pytest.mark.long
def test_directions_without_an_exact_frame_are_said_and_not_fitted(result: FrameResult) -> None:
    tip_mm = result.by_size.tip_mm.copy()
    tip_mm[-1, 0] = np.nan
    holed = replace(result, by_size=result.by_size._replace(tip_mm=tip_mm))
    assert frame_experiment.order(holed) == pytest.approx(2.0, abs=0.02)
    assert "At 10 mm some directions have no exact frame" in frame_page.sentences(holed)[0]
    assert "no exact frame" not in frame_page.sentences(result)[0]


@pytest.mark.parametrize(
    ("mm", "text"),
    [(1.4e-7, "0.14 nm"), (6.2e-5, "62 nm"), (1e-4, "0.1 um"), (0.036, "36 um"), (0.1, "0.1 mm"), (123.4, "120 mm")],
)
def test_lengths_are_told_in_the_unit_that_suits_them(mm: float, text: str) -> None:
    assert frame_page.length_text(mm) == text


@pytest.mark.long
def test_the_committed_picture_is_what_the_experiment_finds() -> None:
    def numbers(svg: str) -> list[float]:
        return [float(number) for number in re.findall(r"\d+\.\d", svg)]

    committed, drawn = frame_picture.PICTURE.read_text(encoding="utf-8"), frame_picture.picture()
    assert re.sub(r"\d+\.\d", "#", committed) == re.sub(r"\d+\.\d", "#", drawn)
    np.testing.assert_allclose(numbers(committed), numbers(drawn), rtol=0, atol=1.0)  # a pixel
