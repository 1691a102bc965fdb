"""Tables in a terminal of 80 columns, with names whole."""

from __future__ import annotations

from collections.abc import Sequence

# A cell with several names or words is broken between them where it is wider.
_WIDEST_SENTENCE = 24


def name_column_width(cells: Sequence[str]) -> int:
    """Width of a column whose cells are names, which are to be copied whole: no word of them is broken or cut.

    Where a table is wider than the terminal, rich cuts words, but not in a column that has a width.
    """
    longest_cell = max(map(len, cells), default=0)
    longest_word = max((len(word) for cell in cells for word in cell.split()), default=0)
    return min(longest_cell, max(longest_word, _WIDEST_SENTENCE))
