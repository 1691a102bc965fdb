"""Refined constants: between a chosen value and its neighbours of the grid, and nowhere else."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from compd.comparison import AlignedRecording
from compd.diagnosis.candidate_criteria import CandidateCriteria
from compd.diagnosis.candidates.candidates import library_pool, variant
from compd.diagnosis.candidates.refined_constants import refined_variants
from compd.diagnosis.recording_diagnosis import diagnose
from tests.support.external_recordings import along, record_external
from tests.support.hidden_effects import LIBRARY, record_with_effects

LAG = along(
    "z",
    "bed",
    "k * lag(temperature_bed_degC - 20, tau)",
    parameters={
        "k": {"unit": "um/K", "plausible": [-100, 100], "source": "a test"},
        "tau": {"unit": "s", "plausible": [100, 6400], "source": "a test"},
    },
)
PLAIN = along("z", "gain", "k * temperature_bed_degC")


@pytest.fixture(scope="module")
def aligned(tmp_path_factory: pytest.TempPathFactory) -> AlignedRecording:
    bed = 20 + np.repeat([0.0, 40.0, 10.0, 30.0], 50)
    return record_external(
        tmp_path_factory.mktemp("bed") / "run.csv", {"temperature_bed_degC": bed}, {"z": np.zeros(200)}
    )


def test_values_lie_between_the_chosen_one_and_its_neighbours(aligned: AlignedRecording) -> None:
    candidates = library_pool(aligned, [LAG, PLAIN], ()).candidates
    grid = sorted(each.constants["tau"] for each in candidates if each.name == "bed")
    chosen = next(k for k, each in enumerate(candidates) if each.constants.get("tau") == grid[2])
    refined = refined_variants(candidates, [chosen], aligned)
    values = [each.constants["tau"] for each in refined]
    assert len(values) == 2 * CandidateCriteria.constants_between
    assert all(grid[1] < value < grid[3] and value != grid[2] for value in values)
    ratios = np.diff(np.log(sorted([grid[1], *values, grid[2], grid[3]])))
    np.testing.assert_allclose(ratios, ratios[0])  # evenly by factors, for times are
    assert {each.parameter_count for each in refined} == {candidates[chosen].parameter_count}
    assert refined[0].columns_um.shape == candidates[chosen].columns_um.shape


def test_at_the_end_of_a_grid_values_lie_on_one_side(aligned: AlignedRecording) -> None:
    candidates = library_pool(aligned, [LAG], ()).candidates
    assert len(refined_variants(candidates, [0], aligned)) == CandidateCriteria.constants_between


def test_a_second_round_goes_between_refined_values(aligned: AlignedRecording) -> None:
    candidates = list(library_pool(aligned, [LAG], ()).candidates)
    first = refined_variants(candidates, [1], aligned)
    again = refined_variants([*candidates, *first], [1], aligned)
    widest = max(abs(np.log(each.constants["tau"] / candidates[1].constants["tau"])) for each in again)
    nearest = min(abs(np.log(each.constants["tau"] / candidates[1].constants["tau"])) for each in first)
    assert widest < nearest


CYCLE = along(
    "z",
    "cycle",
    "a * sin(2 * pi * way_mm / p) + b * cos(2 * pi * way_mm / p)",
    parameters={
        "a": {"unit": "um", "plausible": [-100, 100], "source": "a test"},
        "b": {"unit": "um", "plausible": [-100, 100], "source": "a test"},
        "p": {"unit": "mm", "plausible": [10, 400], "source": "a test"},
    },
)


def test_a_period_is_refined_within_a_quarter_of_a_turn(tmp_path: Path) -> None:
    aligned = record_external(tmp_path / "run.csv", {"way_mm": np.linspace(0, 300, 200)}, {"z": np.zeros(200)})
    (chosen,) = [variant(CYCLE, {"p": 75.0}, aligned, 3)]
    first = refined_variants([chosen], [0], aligned)
    turns = [300 / each.constants["p"] for each in first]
    assert len(turns) == 2 * CandidateCriteria.constants_between
    assert all(abs(turn - 4.0) < 0.25 for turn in turns)
    assert {each.searched_parameters for each in first} == {3}


def test_a_period_is_not_refined_beyond_what_is_plausible(tmp_path: Path) -> None:
    aligned = record_external(tmp_path / "run.csv", {"way_mm": np.linspace(0, 500, 200)}, {"z": np.zeros(200)})
    for end in (10.0, 400.0):
        refined = refined_variants([variant(CYCLE, {"p": end}, aligned, 3)], [0], aligned)
        assert all(10 <= each.constants["p"] <= 400 for each in refined)


def test_a_period_that_little_noise_tells_well_is_named_and_not_described(tmp_path: Path) -> None:
    """Ramps over four turns: the spectrum is as coarse as a description's first value, and coarser than its second."""
    way = np.concatenate([np.linspace(0, end, 200) for end in (40.0, 150.0, 300.0, 300.0, 150.0, 40.0)])
    error = 30.0 * np.sin(2 * np.pi * way / 72.0 + 0.4)
    aligned = record_external(tmp_path / "run.csv", {"way_mm": way}, {"z": error}, declared_um=None)
    diagnosis = diagnose(aligned, (), None, [CYCLE])
    (step,) = diagnosis.steps
    assert step.effect.id == "cycle"
    assert step.fitted.constants["p"] == pytest.approx(72.0, rel=2e-3)
    assert diagnosis.heldout_after_um < 0.7  # of a noise of 0.5


def test_a_period_that_the_machine_is_said_to_have_stays(tmp_path: Path) -> None:
    aligned = record_with_effects(tmp_path / "run.csv", 1, {})
    cyclic = LIBRARY["scale_cyclic"]
    ((constants,),) = [cyclic.constant_grid(aligned.rows)]
    assert refined_variants([variant(cyclic, constants, aligned, 0)], [0], aligned) == []


def test_without_a_nonlinear_constant_there_is_nothing_between(aligned: AlignedRecording) -> None:
    candidates = library_pool(aligned, [PLAIN], ()).candidates
    assert refined_variants(candidates, [0], aligned) == []
