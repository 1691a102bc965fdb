"""Rows that were written twice, told from repeats that are alike."""

from __future__ import annotations

import numpy as np

from compd.arrays import FloatArray
from compd.statistics import copied_rows, doubled_rows


def display(rows: int = 24) -> FloatArray:
    """A coarse display beside the number of a place: neighbours are often alike."""
    rng = np.random.default_rng(4)
    return np.column_stack([np.repeat(np.arange(rows // 3), 3), rng.integers(0, 2, rows)]).astype(np.float64)


def test_a_table_that_was_written_twice_has_every_second_row_as_a_copy() -> None:
    once = display()
    twice = np.repeat(once, 2, axis=0)
    assert not copied_rows(twice, np.ones(len(twice), dtype=bool)).any(), "chance, each row by itself"
    np.testing.assert_array_equal(np.flatnonzero(doubled_rows(twice)), np.arange(1, len(twice), 2))


def test_repeats_that_a_coarse_display_shows_alike_are_no_copies() -> None:
    once = display()
    assert (once[1:] == once[:-1]).all(axis=1).sum() > 5
    assert not doubled_rows(once).any()


def test_a_table_with_a_single_row_of_its_own_was_not_written_twice() -> None:
    twice = np.repeat(display(), 2, axis=0)
    assert not doubled_rows(np.delete(twice, 7, axis=0)).any()


def test_a_short_table_may_be_even_by_chance() -> None:
    twice = np.repeat(np.arange(6.0), 2)[:, None]
    assert not doubled_rows(twice).any()
    assert doubled_rows(np.repeat(np.arange(7.0), 2)[:, None]).sum() == 7


def test_an_empty_cell_equals_another() -> None:
    once = np.arange(20.0).reshape(10, 2)
    once[3, 1] = np.nan
    assert doubled_rows(np.repeat(once, 2, axis=0)).sum() == 10
