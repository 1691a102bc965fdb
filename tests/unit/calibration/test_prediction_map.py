"""How uncertain a prediction is over the workspace, and how far it errs on machines that the simulation has built."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import compd
from compd.arrays import rms
from compd.calibration import PredictionMap
from compd.machine_kinds import KINDS
from tests.support.built_machines import REACH_MM, REACH_RAD, World, built, drawing, record, targets

POSES = 40


def learned_in_the_middle(kind: str, directory: Path) -> tuple[compd.Calibration, PredictionMap]:
    """From positions in the middle half of the workspace, with a sealed recording of all of it."""
    rng = np.random.default_rng([2, list(KINDS).index(kind)])
    world = built(drawing(kind, directory), rng)
    middle = ((place / 2, turn / 2) for place, turn in targets(world, rng))
    learned = record(directory / "middle.csv", world, rng, POSES, wanted=middle, pose=False)
    everywhere = record(directory / "all.csv", world, rng, 100, noise=0.0, pose=False)
    result = compd.calibrate(compd.open_recording(learned), compd.open_recording(everywhere))
    assert result.prediction is not None
    return result, result.prediction


@pytest.mark.parametrize(
    "kind",
    [
        "6-ups",
        *(pytest.param(kind, marks=[pytest.mark.long, pytest.mark.sample]) for kind in ("3-prs", "linear-delta")),
    ],
)
def test_the_error_elsewhere_is_as_large_as_said_and_grows_outside(kind: str, tmp_path: Path) -> None:
    result, prediction = learned_in_the_middle(kind, tmp_path)
    off_mm = np.abs(prediction.place_mm - prediction.measured_mm.mean(axis=0))
    near = (off_mm < REACH_MM).all(axis=1) & (np.abs(prediction.turn_rad) < REACH_RAD).all(axis=1)
    assert near.sum() > 5
    error_um = 1e3 * rms(np.linalg.norm(result.sealed[0].after_mm, axis=1))
    # one machine has about ten independent errors
    assert 0.25 < error_um / rms(prediction.std_um[near]) < 2.0
    assert np.median(prediction.std_um) > 1.5 * np.median(prediction.measured_std_um)


def test_slices_cover_the_workspace_with_the_measured_poses(tmp_path: Path) -> None:
    _, prediction = learned_in_the_middle("linear-delta", tmp_path)
    assert [(one.across, one.up) for one in prediction.slices] == [("x", "y"), ("x", "z"), ("y", "z")]
    for one in prediction.slices:
        assert one.std_um.shape == one.std_urad.shape == (len(one.up_at), len(one.across_at))
        known = np.isfinite(one.std_um)
        assert known.mean() > 0.3
        assert (one.std_um[known] > 0).all()
        places_mm = prediction.measured_mm[:, "xyz".index(one.across)]
        assert one.across_at[0] <= places_mm.min()
        assert places_mm.max() <= one.across_at[-1]
    assert f"largest {prediction.std_um.max():.3g} um" in prediction.words


@pytest.mark.long
@pytest.mark.sample
def test_slices_of_a_hexapod_are_through_places_and_through_turns(tmp_path: Path) -> None:
    _, prediction = learned_in_the_middle("6-ups", tmp_path)
    places, turns = prediction.slices[:3], prediction.slices[3:]
    assert [one.across + one.up for one in prediction.slices] == ["xy", "xz", "yz", "ab", "ac", "bc"]
    assert places[0].held.endswith("mm, no turn")
    for one in turns:
        measured_rad = prediction.measured_rad[:, "abc".index(one.across)]
        assert one.across_at[0] <= measured_rad.min() < measured_rad.max() <= one.across_at[-1]
        # in the middle it has the value of the slices through places
        middle = len(one.up_at) // 2
        assert one.std_um[middle, middle] == pytest.approx(places[0].std_um[middle, middle])


@pytest.mark.long
@pytest.mark.sample
def test_a_map_ends_where_the_links_do(tmp_path: Path) -> None:
    """A stroke that the configuration states; without one, a share of a link's length."""
    widths = []
    for limits in ("", "  link_length_mm: [490, 570]\n"):
        path = drawing("6-ups", tmp_path)
        text = path.read_text(encoding="utf-8")
        path.write_text(text.replace("  actuators:", f"{limits}  actuators:"), encoding="utf-8")
        rng = np.random.default_rng(5)
        world = built(path, rng)
        middle = ((place / 4, turn / 4) for place, turn in targets(world, rng))
        recording = compd.open_recording(record(tmp_path / "near.csv", world, rng, POSES, wanted=middle))
        prediction = compd.calibrate(recording).prediction
        assert prediction is not None
        widths.append(np.ptp(prediction.place_mm[:, 2]))
    assert widths[1] < 0.7 * widths[0]


def ratio(world: World, directory: Path, rng: np.random.Generator, pose: bool) -> float:
    """Error of the tip over its standard error, rms over the workspace."""
    learned = record(directory / "learned.csv", world, rng, POSES, pose=pose)
    # of the tip itself: a target on the platform would hide where the tip is
    other = record(directory / "tips.csv", world, rng, 100, noise=0.0, pose=False)
    result = compd.calibrate(compd.open_recording(learned), compd.open_recording(other))
    assert result.prediction is not None
    off_mm = np.abs(result.prediction.place_mm - result.prediction.measured_mm.mean(axis=0))
    near = (off_mm < REACH_MM).all(axis=1) & (np.abs(result.prediction.turn_rad) < REACH_RAD).all(axis=1)
    error_um = 1e3 * rms(np.linalg.norm(result.sealed[0].after_mm, axis=1))
    return error_um / rms(result.prediction.std_um[near])


@pytest.mark.long
@pytest.mark.timeout(900)
@pytest.mark.parametrize("pose", [True, False], ids=["poses", "positions"])
@pytest.mark.parametrize("kind", KINDS)
def test_the_tip_errs_by_its_standard_error(kind: str, pose: bool, tmp_path: Path) -> None:
    """Of five machines together: single ones have about ten independent errors, and a common one in all joints."""
    ratios = []
    for seed in range(5):
        rng = np.random.default_rng([400, seed, list(KINDS).index(kind)])
        ratios.append(ratio(built(drawing(kind, tmp_path), rng), tmp_path, rng, pose))
    assert 0.5 < rms(np.array(ratios)) < 1.6, np.round(ratios, 2)
