"""Refined constants: between a chosen value and its neighbours of the grid, and nowhere else."""

from __future__ import annotations

import numpy as np
import pytest

from compd.comparison.aligned_recording import AlignedRecording
from compd.diagnosis.candidates.candidates import library_pool
from compd.diagnosis.candidates.refined_constants import BETWEEN, refined_variants
from tests.support.external_recordings import along, record_external

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
    assert len(values) == 2 * BETWEEN
    assert all(grid[1] < value < grid[3] and value != grid[2] for value in values)
    ratios = np.diff(np.log(sorted([grid[1], *values, grid[2], grid[3]])))
    np.testing.assert_allclose(ratios, ratios[0])  # evenly by factors, for times are
    assert {each.parameter_count for each in refined} == {candidates[chosen].parameter_count}
    assert refined[0].columns_um.shape == candidates[chosen].columns_um.shape


def test_at_the_end_of_a_grid_values_lie_on_one_side(aligned: AlignedRecording) -> None:
    candidates = library_pool(aligned, [LAG], ()).candidates
    assert len(refined_variants(candidates, [0], aligned)) == BETWEEN


def test_a_second_round_goes_between_refined_values(aligned: AlignedRecording) -> None:
    candidates = list(library_pool(aligned, [LAG], ()).candidates)
    first = refined_variants(candidates, [1], aligned)
    again = refined_variants([*candidates, *first], [1], aligned)
    widest = max(abs(np.log(each.constants["tau"] / candidates[1].constants["tau"])) for each in again)
    nearest = min(abs(np.log(each.constants["tau"] / candidates[1].constants["tau"])) for each in first)
    assert widest < nearest


def test_without_a_nonlinear_constant_there_is_nothing_between(aligned: AlignedRecording) -> None:
    candidates = library_pool(aligned, [PLAIN], ()).candidates
    assert refined_variants(candidates, [0], aligned) == []
