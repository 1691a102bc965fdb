"""An instrument that repeats its last digits while the machine is at other places is named, with its rows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from compd.recording.checks import check_frozen_reference
from compd.tables import FIRST_ROW, ProblemList, Table

N = 60
PLACES_MM = np.repeat(np.random.default_rng(8).uniform(-100.0, 100.0, (N // 3, 3)), 3, axis=0)  # three rows at each


def table(frozen: slice, machine: str = "model", digits: int = 6) -> Table:
    measured = np.round(PLACES_MM + np.random.default_rng(9).normal(0.0, 1e-3, PLACES_MM.shape), digits)
    measured[frozen] = measured[frozen][:1]
    names = ["scale_1_mm", "scale_2_mm", "scale_3_mm"] if machine == "scales" else [f"model_{a}_mm" for a in "xyz"]
    columns = dict(zip(names, PLACES_MM.T.copy(), strict=True))
    columns |= {f"reference_{a}_mm": column for a, column in zip("xyz", measured.T, strict=True)}
    return Table(Path("visit.csv"), {}, columns, np.arange(N) + FIRST_ROW)


def warnings_of(checked: Table) -> list[str]:
    problems = ProblemList(checked.path)
    check_frozen_reference(checked, problems)
    assert not problems.problems
    return [str(warning) for warning in problems.warnings]


@pytest.mark.parametrize("machine", ["model", "scales"])
def test_the_rows_are_named(machine: str) -> None:
    (warning,) = warnings_of(table(slice(10, 40), machine))
    assert "rows 12 to 41" in warning
    assert "the same digits at 11 different places" in warning


def test_several_times_are_told_together() -> None:
    both = table(slice(10, 20))
    for axis in "xyz":
        both.columns[f"reference_{axis}_mm"][40:50] = both.columns[f"reference_{axis}_mm"][40]
    (warning,) = warnings_of(both)
    assert "rows 12, 13, 14 and 17 more rows" in warning


def test_repeats_at_one_place_may_have_the_same_digits() -> None:
    assert warnings_of(table(slice(0, 0), digits=1)) == []
    assert warnings_of(table(slice(0, 0))) == []


def test_a_single_axis_and_empty_cells_are_not_looked_at() -> None:
    flat = table(slice(0, 0))
    for axis in "xy":
        del flat.columns[f"reference_{axis}_mm"]
    flat.columns["reference_z_mm"][:] = 5.0
    assert warnings_of(flat) == []
    empty = table(slice(0, 0))
    for axis in "xyz":
        empty.columns[f"reference_{axis}_mm"][10:40] = np.nan
    assert warnings_of(empty) == []


def test_rows_of_which_nobody_knows_the_place_are_not_told() -> None:
    """The same digits twice, and in each of the two rows a scale is empty."""
    unplaced = table(slice(10, 12), "scales")
    unplaced.columns["scale_1_mm"][10] = unplaced.columns["scale_3_mm"][11] = np.nan
    assert warnings_of(unplaced) == []


def test_a_link_that_is_frozen_is_told() -> None:
    columns = {"scale_2_mm": PLACES_MM[:, 0], "reference_link_2_mm": PLACES_MM[:, 0] + 480.0}
    columns["reference_link_2_mm"][10:40] = 481.25
    (warning,) = warnings_of(Table(Path("visit.csv"), {}, columns, np.arange(N) + FIRST_ROW))
    assert "rows 12 to 41" in warning
