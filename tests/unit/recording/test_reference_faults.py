"""Rows whose reference is no measurement are named, and do not count."""

from __future__ import annotations

import numpy as np
import pytest

from compd.data_fault import DataFault
from compd.recording.reference_faults import reference_faults

N = 60
ROW = np.arange(N) + 2
PLACES_MM = np.repeat(np.random.default_rng(8).uniform(-100.0, 100.0, (N // 3, 3)), 3, axis=0)  # three rows at each


def columns_of(machine: str = "model", digits: int = 6) -> dict[str, np.ndarray]:
    measured = np.round(PLACES_MM + np.random.default_rng(9).normal(0.0, 1e-3, PLACES_MM.shape), digits)
    names = ["scale_1_mm", "scale_2_mm", "scale_3_mm"] if machine == "scales" else [f"model_{a}_mm" for a in "xyz"]
    columns = dict(zip(names, PLACES_MM.T.copy(), strict=True))
    return columns | {f"reference_{a}_mm": column for a, column in zip("xyz", measured.T.copy(), strict=True)}


def with_reference(columns: dict[str, np.ndarray], rows: slice | list[int], value: object = None) -> dict:
    """The columns with a reference that is frozen in some rows, or of one value on all axes."""
    first = rows.start if isinstance(rows, slice) else rows[0]
    for axis in "xyz":
        if (column := columns.get(f"reference_{axis}_mm")) is not None:
            column[rows] = column[first] if value is None else value
    return columns


def faults_of(columns: dict[str, np.ndarray], same_frame: bool = True) -> list[DataFault]:
    return reference_faults(columns, ROW[: len(next(iter(columns.values())))], same_frame)


@pytest.mark.parametrize("machine", ["model", "scales"])
def test_rows_that_repeat_a_reading_at_other_places_are_left_out_and_the_reading_itself_counts(machine: str) -> None:
    (fault,) = faults_of(with_reference(columns_of(machine), slice(10, 40)))
    assert fault.rows == tuple(range(13, 42))
    assert "the reference holds the digits of row 12 at 11 different places" in fault.text
    assert fault.consequence == "rows left out"


def test_several_times_are_told_together() -> None:
    both = with_reference(with_reference(columns_of(), slice(10, 20)), slice(40, 50))
    (fault,) = faults_of(both)
    assert fault.text.startswith("rows 13 to 21 and 43 to 51: ")


def test_repeats_at_one_place_may_have_the_same_digits() -> None:
    assert faults_of(columns_of(digits=1)) == []
    assert faults_of(columns_of()) == []


def test_coarse_digits_at_near_places_are_no_fault() -> None:
    near = columns_of()
    for axis in "xyz":
        near[f"model_{axis}_mm"] = np.linspace(0.0, 3.0, N)
        near[f"reference_{axis}_mm"] = np.round(near[f"model_{axis}_mm"])
    assert faults_of(near) == []


def test_an_axis_that_is_frozen_alone_is_told_by_what_the_model_misses() -> None:
    columns = columns_of()
    columns["reference_y_mm"][20:45] = columns["reference_y_mm"][20]
    (fault,) = faults_of(columns)
    assert fault.columns == ("reference_y_mm",)
    assert fault.rows == tuple(range(23, 47))


def test_a_plane_or_a_straight_edge_as_reference_is_no_fault() -> None:
    flat = columns_of()
    for axis in "xy":
        del flat[f"reference_{axis}_mm"]
    flat["reference_z_mm"][:] = 5.0
    assert faults_of(flat) == []


def test_empty_cells_are_no_digits() -> None:
    assert faults_of(with_reference(columns_of(), slice(10, 40), np.nan)) == []


def test_rows_of_which_nobody_knows_the_place_are_not_told() -> None:
    """The same digits twice, and in each of the two rows a scale is empty."""
    unplaced = with_reference(columns_of("scales"), slice(10, 12))
    unplaced["scale_1_mm"][10] = unplaced["scale_3_mm"][11] = np.nan
    assert faults_of(unplaced) == []


def test_a_link_that_is_frozen_is_told() -> None:
    columns = {"scale_2_mm": PLACES_MM[:, 0], "reference_link_2_mm": PLACES_MM[:, 0] + 480.0}
    columns["reference_link_2_mm"][10:40] = 481.25
    (fault,) = faults_of(columns)
    assert fault.rows == tuple(range(13, 42))


@pytest.mark.parametrize("value", [0.0, -9999.0, 99999.0])
def test_rows_without_a_reading_are_told_where_the_machine_is_elsewhere(value: float) -> None:
    (fault,) = faults_of(with_reference(columns_of(), [7, 33], value))
    assert fault.rows == (9, 35)
    assert "the instrument had no reading" in fault.text
    (height,) = faults_of({k: v for k, v in with_reference(columns_of(), [7], value).items() if k.endswith("z_mm")})
    assert height.rows == (9,)


def test_the_first_point_may_be_the_zero() -> None:
    columns = columns_of()
    for axis in "xyz":
        columns[f"reference_{axis}_mm"] -= columns[f"reference_{axis}_mm"][0]
        columns[f"model_{axis}_mm"] -= columns[f"model_{axis}_mm"][0]
    assert columns["reference_x_mm"][0] == columns["reference_z_mm"][0] == 0
    assert faults_of(columns) == []


@pytest.mark.parametrize("machine", ["model", "scales"])
def test_a_position_that_is_not_recorded_any_more_is_told(machine: str) -> None:
    columns = columns_of(machine)
    own = tuple(name for name in columns if not name.startswith("reference"))
    for name in own:
        columns[name][30:50] = columns[name][30]
    (fault,) = faults_of(columns)
    assert fault.columns == own
    assert fault.rows == tuple(range(33, 52))
