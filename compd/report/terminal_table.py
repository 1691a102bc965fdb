"""Tables for a terminal of 80 columns; names for copying and numbers stay whole."""

from __future__ import annotations

from rich.table import Table
from rich.text import Text

# Two spaces and a line for each column, and the first line.
_CELL_FRAME, _FIRST_LINE = 3, 1


def keep_words_whole(table: Table, width: int) -> Table:
    """The table with columns wide enough to break lines between words only; `width`: of the terminal.

    Where a table is wider than the terminal, rich cuts words, but not in a column that has a width. What is left over
    goes to the columns whose texts are longest. Where even the words need more, the lines between columns go.
    """
    texts = [[_plain(column.header), *map(_plain, column.cells)] for column in table.columns]
    whole = [max(len(line) for text in column for line in text.split("\n")) for column in texts]
    words = [max((len(word) for text in column for word in text.split()), default=0) for column in texts]
    widths = [whole[k] if column.no_wrap else words[k] for k, column in enumerate(table.columns)]
    left = width - sum(widths) - _CELL_FRAME * len(widths) - _FIRST_LINE
    if left < 0:
        table.box = None
        left += len(widths) + _FIRST_LINE
    while left > 0 and widths != whole:
        narrowest = max(range(len(widths)), key=lambda k: whole[k] / max(widths[k], 1))
        widths[narrowest] += 1
        left -= 1
    for column, cells in zip(table.columns, widths, strict=True):
        column.width = cells
    return table


def _plain(cell: object) -> str:
    return cell.plain if isinstance(cell, Text) else Text.from_markup(str(cell)).plain
