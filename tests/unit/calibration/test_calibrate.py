"""Calibrations of machines that `compd.simulation` builds otherwise than drawn."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import compd
from compd.arrays import FloatArray
from compd.calibration import check_calibration
from compd.comparison import AlignedRecording
from compd.machine_kinds import KINDS
from tests.support.built_machines import NOISE_MM, REACH_MM, REACH_RAD, World, built, deviations, drawing, record

POSES = 60


def world_of(directory: Path, kind: str, seed: int, tolerance_mm: float = 0.05) -> tuple[World, np.random.Generator]:
    rng = np.random.default_rng([seed, list(KINDS).index(kind)])
    return built(drawing(kind, directory, tolerance_mm), rng, tolerance_mm), rng


def opened(path: Path) -> AlignedRecording:
    return compd.open_recording(path)


@pytest.mark.parametrize("kind", KINDS)
def test_other_poses_are_predicted_better_and_numbers_are_as_sure_as_claimed(kind: str, tmp_path: Path) -> None:
    world, rng = world_of(tmp_path, kind, seed=3)
    learned = opened(record(tmp_path / "monday.csv", world, rng, POSES))
    other = opened(record(tmp_path / "other.csv", world, rng, POSES, noise=0.0))
    result = compd.calibrate(learned, other)
    sealed = result.sealed[0]
    assert sealed.after_rms_um < 0.5 * sealed.before_rms_um
    assert result.held_out[0].after_rms_um < 2 * 1e3 * NOISE_MM < result.held_out[0].before_rms_um * 2
    # of 50 numbers one is beyond 4.5 standard errors by chance once in 3,000
    assert np.abs(deviations(world, learned, result)).max(initial=0.0) < 4.5


def test_a_number_that_no_pose_tells_is_held_and_said(tmp_path: Path) -> None:
    world, rng = world_of(tmp_path, "6-ups", seed=1)
    result = compd.calibrate(opened(record(tmp_path / "monday.csv", world, rng, POSES)))
    words = [one.words for one in result.held]
    assert "all base joints together, along x" in words
    assert "all platform joints together, turned about z" in words
    assert all(one.share > 0.7 for one in result.held)


def test_the_machine_is_found_by_the_sidecar(tmp_path: Path) -> None:
    world, rng = world_of(tmp_path, "linear-delta", seed=1)
    assert opened(record(tmp_path / "monday.csv", world, rng, 12)).recording.machine == "linear-delta"


def test_gross_poses_are_listed_and_left_out(tmp_path: Path) -> None:
    world, rng = world_of(tmp_path, "6-ups", seed=2)
    learned = opened(record(tmp_path / "monday.csv", world, rng, POSES, gross_mm={7: 0.5, 30: -1.0}))
    other = opened(record(tmp_path / "other.csv", world, rng, POSES, noise=0.0))
    result = compd.calibrate(learned, other)
    # the header is row 1
    assert [pose.row for pose in result.gross] == [9, 32]
    assert result.gross[1].error_mm == pytest.approx(1.0, abs=0.05)
    assert result.sealed[0].after_rms_um < 1e3 * NOISE_MM


def flat(world: World, rng: np.random.Generator) -> Iterator[tuple[FloatArray, FloatArray]]:
    """A grid at one height, the platform level."""
    for x in np.linspace(-70, 70, 8):
        for y in np.linspace(-70, 70, 8):
            yield np.array([x, y, 0.0]), np.zeros(3)


@pytest.mark.long
@pytest.mark.sample
def test_gains_from_one_height_stay_as_drawn_with_a_warning(tmp_path: Path) -> None:
    world, rng = world_of(tmp_path, "6-ups", seed=5, tolerance_mm=1.0)
    # gains that change with the reading, by 0.3 mm at the ends
    world = world._replace(bend=60e-6 * rng.standard_normal(6))
    result = compd.calibrate(opened(record(tmp_path / "flat.csv", world, rng, 64, flat(world, rng))))
    assert not next(block for block in result.blocks if block.name == "scale_gain_change").needed
    assert any("along z" in warning and "no pose of these tests" in warning for warning in result.warnings)


def at_one_height(world: World) -> Iterator[tuple[FloatArray, FloatArray]]:
    """A grid in x and y, or in two turns where a target fixes no x and y, at the height of machine zero."""
    fixed = world.drawn.fixed
    for a in np.linspace(-1, 1, 8):
        for b in np.linspace(-1, 1, 8):
            place, turn = np.array([a, b, 0.0]) * REACH_MM, np.array([a, b, 0.0]) * REACH_RAD
            yield (place, np.zeros(3)) if fixed[0] else (np.zeros(3), turn)


@pytest.mark.long
@pytest.mark.parametrize("seed", [31, 32])
@pytest.mark.parametrize("pose", [True, False], ids=["poses", "positions"])
@pytest.mark.parametrize("kind", ["6-pus", "6-rus", "3-spr", "3-rps", "3-prs", "linear-delta", "rotary-delta"])
def test_poses_at_one_height_end_in_refusals_or_warnings(kind: str, pose: bool, seed: int, tmp_path: Path) -> None:
    world, rng = world_of(tmp_path, kind, seed, tolerance_mm=1.0)
    world = world._replace(bend=60e-6 * rng.standard_normal(world.drawn.scales))
    learned = record(tmp_path / "flat.csv", world, rng, 64, at_one_height(world), pose=pose)
    try:
        result = compd.calibrate(opened(learned))
    except compd.CompdError:
        return
    assert any("along z" in warning for warning in result.warnings)


@pytest.mark.long
@pytest.mark.sample
def test_several_recordings_with_instruments_of_their_own_tell_more_than_one(tmp_path: Path) -> None:
    world, rng = world_of(tmp_path, "6-pus", seed=4)
    days = [opened(record(tmp_path / f"day-{day}.csv", world, rng, 30)) for day in range(3)]
    other = opened(record(tmp_path / "other.csv", world, rng, POSES, noise=0.0))
    one, three = compd.calibrate(days[0], other), compd.calibrate(days, other)
    assert len(three.learned) == 3
    assert three.sealed[0].after_rms_um < one.sealed[0].after_rms_um


@pytest.mark.long
@pytest.mark.sample
def test_positions_of_a_reflector_alone_serve_as_well(tmp_path: Path) -> None:
    world, rng = world_of(tmp_path, "linear-delta", seed=6)
    learned = opened(record(tmp_path / "monday.csv", world, rng, POSES, pose=False))
    other = opened(record(tmp_path / "other.csv", world, rng, POSES, noise=0.0, pose=False))
    result = compd.calibrate(learned, other)
    assert result.sealed[0].after_rms_um < 0.5 * result.sealed[0].before_rms_um


THREE = {"A": [60.0, 0.0, -15.0], "B": [-30.0, 50.0, 10.0], "C": [-30.0, -50.0, 25.0]}


@pytest.mark.long
@pytest.mark.sample
def test_three_reflectors_at_different_places_tell_what_turns_the_platform(tmp_path: Path) -> None:
    world, rng = world_of(tmp_path, "6-ups", seed=6)
    learned = opened(record(tmp_path / "monday.csv", world, rng, 3 * POSES, pose=False, reflectors=THREE))
    alone = opened(record(tmp_path / "alone.csv", world, rng, POSES, pose=False))
    other = opened(record(tmp_path / "other.csv", world, rng, POSES, noise=0.0))
    three, one = compd.calibrate(learned, other), compd.calibrate(alone, other)
    assert three.sealed[0].after_rms_um < 0.3 * three.sealed[0].before_rms_um
    assert three.sealed[0].after_rms_um < one.sealed[0].after_rms_um
    off = deviations(world, learned, three)
    assert len(off) > len(deviations(world, alone, one))
    assert np.abs(off).max() < 4.5


def test_the_place_of_a_reflector_is_that_of_the_tip_where_it_is_none(tmp_path: Path) -> None:
    """A recording with one reflector at the tip says the same as one of the tip."""
    world, _ = world_of(tmp_path, "6-ups", seed=6)
    both = [
        opened(record(tmp_path / f"{name}.csv", world, np.random.default_rng(1), 30, pose=False, reflectors=places))
        for name, places in (("tip", None), ("named", {"1": [0.0, 0.0, 0.0]}))
    ]
    tip, named = map(compd.calibrate, both)
    assert [number.change for number in named.numbers] == [number.change for number in tip.numbers]


@pytest.mark.parametrize("kind", ["linear-delta", "rotary-delta"])
def test_the_place_of_a_target_is_no_error_of_a_platform_that_only_shifts(kind: str, tmp_path: Path) -> None:
    """As built it tilts by half a mrad: a target 30 mm from the tip moves by 15 um that are none of the tip."""
    world, rng = world_of(tmp_path, kind, seed=12)
    learned = opened(record(tmp_path / "monday.csv", world, rng, POSES))
    other = opened(record(tmp_path / "other.csv", world, rng, POSES, noise=0.0))
    assert compd.calibrate(learned, other).sealed[0].after_rms_um < 0.7 * 1e3 * NOISE_MM


def test_another_day_holds_and_a_rod_that_was_changed_is_named(tmp_path: Path) -> None:
    world, rng = world_of(tmp_path, "6-ups", seed=7)
    learned = opened(record(tmp_path / "monday.csv", world, rng, 100))
    result = compd.calibrate(learned)
    same = check_calibration(result, [learned], opened(record(tmp_path / "tuesday.csv", world, rng, 40)))
    assert same.holds, same.verdict
    zero_mm = world.zero_mm.copy()
    zero_mm[2] += 0.1
    friday = opened(record(tmp_path / "friday.csv", world._replace(zero_mm=zero_mm), rng, 40))
    changed = check_calibration(result, [learned], friday)
    assert not changed.holds
    assert [change.element for change in changed.changes] == ["rod 3 length"]
    assert changed.changes[0].change == pytest.approx(0.1, abs=4 * changed.changes[0].std)


def test_another_day_may_have_another_instrument_and_gross_rows(tmp_path: Path) -> None:
    world, rng = world_of(tmp_path, "6-ups", seed=10)
    learned = opened(record(tmp_path / "poses.csv", world, rng, POSES))
    later = opened(record(tmp_path / "positions.csv", world, rng, 40, pose=False, gross_mm={4: 0.5}))
    check = check_calibration(compd.calibrate(learned), [learned], later)
    assert check.holds, check.verdict
    # the header is row 1
    assert check.gross == (6,)
    assert "without row 6" in check.verdict


def test_the_result_is_plain_data(tmp_path: Path) -> None:
    world, rng = world_of(tmp_path, "3-spr", seed=8)
    result = compd.calibrate(opened(record(tmp_path / "monday.csv", world, rng, POSES)))
    data = json.loads(json.dumps(result.as_json(), allow_nan=False))
    assert len(data["covariance"]) == len(data["numbers"]) == len(result.numbers)


def test_recordings_of_two_machines_are_refused(tmp_path: Path) -> None:
    both = []
    for kind in ("6-ups", "3-spr"):
        world, rng = world_of(tmp_path, kind, seed=9)
        both.append(opened(record(tmp_path / f"day-{kind}.csv", world, rng, 12)))
    with pytest.raises(compd.CompdError, match="2 machines"):
        compd.calibrate(both)


@pytest.mark.parametrize("seed", range(3))
def test_a_machine_as_drawn_stays_as_drawn(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    world = built(drawing("6-ups", tmp_path), rng, 0.0)
    result = compd.calibrate(opened(record(tmp_path / "monday.csv", world, rng, POSES)))
    # a block of no use may lower the error of one set of poses by chance, and then by little
    for errors in result.held_out:
        assert errors.after_rms_um < 1.05 * errors.before_rms_um
    assert sum(block.needed for block in result.blocks) <= 1
