"""Simulated campaigns with a ballbar, at pins, at a calibrated ball, with poses: what was hidden is found from them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import compd
from compd.comparison import compare
from compd.configuration import load, shipped_configuration
from compd.errors import CompdError
from compd.recording import read_recording
from compd.simulation.truth.fixed_places import BALLBAR_ERROR_MM, BALLBAR_MM, ballbar_places, pin_places
from compd.simulation.truth.instruments import BALLBAR_SIGMA_UM, POSE_SIGMA_URAD, Kind
from compd.simulation.truth.mechanism import Mechanism
from tests.support.measured import aligned, tripod

KINDS = [
    pytest.param("ballbar", "tripod-cmm", marks=[pytest.mark.long, pytest.mark.sample]),
    pytest.param("ball", "tripod-cmm", marks=pytest.mark.long),
    pytest.param("pin", "tripod-cmm", marks=[pytest.mark.long, pytest.mark.sample]),
    pytest.param("pin", "hexapod", marks=pytest.mark.long),
    pytest.param("pose", "hexapod", marks=pytest.mark.long),
]


@pytest.mark.parametrize(("reference", "machine"), KINDS)
def test_a_hidden_spring_is_found_and_the_error_falls(reference: Kind, machine: str, tmp_path: Path) -> None:
    days = []
    for name, other_days in (("first.csv", 0), ("other.csv", 1)):
        path = tmp_path / name
        compd.simulate_campaign(
            machine, path, seed=2, effects=["link_elasticity=30"], reference=reference, other_days=other_days
        )
        days.append(path)
    diagnosis = compd.diagnose(days[0])
    assert "link_elasticity" in [step.effect.id for step in diagnosis.steps]
    found = next(step for step in diagnosis.steps if step.effect.id == "link_elasticity")
    assert found.parameters[0].value == pytest.approx(30.0, rel=0.05)
    assert diagnosis.heldout_after_um < 0.4 * diagnosis.heldout_before_um
    other = aligned(days[1], load(shipped_configuration(f"{machine}.yaml")))
    assert compare(other, diagnosis.after.fitted).rms_um < 0.4 * compare(other).rms_um


@pytest.mark.long
def test_a_ballbar_shows_its_own_noise_and_its_wrong_length(tmp_path: Path) -> None:
    path = tmp_path / "bar.csv"
    compd.simulate_campaign("tripod-cmm", path, seed=4, reference="ballbar")
    recording = read_recording(path)
    assert recording.reference_distance_mm is not None
    assert np.abs(recording.reference_distance_mm - BALLBAR_MM).max() < 0.2
    comparison = compd.compare(path)
    assert comparison.floor.by_axis_um[0] == pytest.approx(BALLBAR_SIGMA_UM, rel=0.2)
    ends = aligned(path).ends
    assert ends is not None
    assert ends.added_mm == pytest.approx(np.full(3, BALLBAR_ERROR_MM), abs=0.003)


@pytest.mark.long
def test_poses_scatter_by_their_own_noise(tmp_path: Path) -> None:
    path = tmp_path / "poses.csv"
    compd.simulate_campaign("hexapod", path, seed=4, reference="pose")
    comparison = compd.compare(path)
    assert comparison.floor.by_axis_um[3:] == pytest.approx(np.full(3, POSE_SIGMA_URAD), rel=0.25)
    assert comparison.attitude_rms_urad < 1.3 * POSE_SIGMA_URAD


def test_a_tripod_comes_to_a_pin_in_one_pose_and_a_hexapod_in_many() -> None:
    rng = np.random.default_rng(1)
    configurations = [tripod(), load(shipped_configuration("hexapod.yaml"))]
    counts = [len(pin_places(Mechanism(machine.geometry), rng).end_of_point) for machine in configurations]
    assert counts == [3, 36]


def test_the_tip_of_a_ballbar_is_on_the_sphere() -> None:
    places = ballbar_places(Mechanism(tripod().geometry), np.random.default_rng(3))
    away_mm = places.tip_M - places.end_M[places.end_of_point]
    assert np.linalg.norm(away_mm, axis=1) == pytest.approx(np.full(48, BALLBAR_MM))


@pytest.mark.long
def test_what_no_pin_can_show_is_not_named(tmp_path: Path) -> None:
    """A grating that is wrong by a share of the way is a constant wherever the tripod comes back to."""
    path = tmp_path / "pins.csv"
    compd.simulate_campaign("tripod-cmm", path, seed=5, effects=["scale_gain=30"], reference="pin")
    diagnosis = compd.diagnose(path)
    assert "scale_gain" not in [step.effect.id for step in diagnosis.steps]
    result = next(candidate for candidate in diagnosis.candidates if candidate.effect == "scale_gain")
    assert result.status == "not_testable"
    assert "shift of the pins" in result.why


def test_a_plan_of_places_is_not_measured_with_a_bar(tmp_path: Path) -> None:
    with pytest.raises(CompdError, match="fixed balls and pins are not where the plan goes"):
        compd.simulate_campaign("tripod-cmm", tmp_path / "x.csv", reference="ballbar", plan=tmp_path / "plan.csv")
