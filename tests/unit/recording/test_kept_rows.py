"""Rows that a table has twice, and rows without a time."""

from __future__ import annotations

import numpy as np

from compd.recording.recording_builder import DOUBLED, NO_TIME, kept_rows


def table(at_rest: int, moving: int) -> dict[str, np.ndarray]:
    """Rows of motions, then rows at rest of which each is there twice."""
    rng = np.random.default_rng(at_rest)
    values = np.concatenate([rng.normal(size=moving), np.repeat(rng.normal(size=at_rest), 2)])
    point = np.concatenate([np.full(moving, np.nan), np.repeat(np.arange(at_rest) // 3, 2)])
    return {"time_s": np.arange(len(values), dtype=np.float64), "point": point, "reference_x_mm": values}


def test_rows_at_rest_that_were_written_twice_count_once_beside_rows_of_a_motion() -> None:
    kept, left_out = kept_rows(table(20, 15))
    np.testing.assert_array_equal(kept, [*range(15), *range(15, 55, 2)])
    assert left_out == {NO_TIME: 0, DOUBLED: 20}


def test_one_row_at_rest_that_is_there_once_leaves_all_in() -> None:
    columns = {name: np.delete(values, 20) for name, values in table(20, 15).items()}
    kept, left_out = kept_rows(columns)
    assert len(kept) == 54
    assert left_out[DOUBLED] == 0


def test_a_row_without_a_time_is_none() -> None:
    columns = table(3, 0)
    columns["time_s"][2] = np.nan
    kept, left_out = kept_rows(columns)
    assert 2 not in kept
    assert left_out[NO_TIME] == 1
