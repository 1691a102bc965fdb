"""Where the list stands in a sheet: its header, what stands above it, and headers that are repeated."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from compd.errors import RecordingError
from compd.instruments.formats.workbook.cells import TEXT, VALUES, Row
from compd.instruments.header_names import is_unit_row, with_units

AGAIN = "the header again"


@dataclass(frozen=True)
class SheetTable:
    """The list."""

    rows: Sequence[Row]  #: below the header, one or more
    header: tuple[str, ...] | None  #: names of the columns from A on; None without one
    header_row: int  #: its number; 0 without one
    assumed: Mapping[str, str] = field(default_factory=dict)  #: in words, what was found
    left_out: Mapping[str, int] = field(default_factory=dict)  #: reason -> rows


def find_table(place: str, rows: Sequence[Row]) -> SheetTable:
    """Find the list among the rows of a sheet that are not empty.

    The header is the row of text alone, over every column in which most rows have a number, that the most rows follow.
    A row of units below it counts to it.

    Raises RecordingError if no row holds a number, or another header stands in the middle.
    """
    columns = _columns_of_numbers(rows)
    if not columns:
        raise RecordingError.of(place, "holds no number", next_step="choose another with --sheet")
    heads = [k for k, row in enumerate(rows) if _is_head(row, columns)]
    if not heads:
        begin = next(k for k, row in enumerate(rows) if any(kind in VALUES for kind in row.kinds))
        return SheetTable(rows[begin:], None, 0, _above(rows[:begin]))
    ends = [*heads[1:], len(rows)]
    longest = max(range(len(heads)), key=lambda k: ends[k] - heads[k])
    names = _names(rows[heads[longest]])
    first = next(k for k in heads if _names(rows[k]) == names)
    header, header_row, begin, assumed = names, rows[first].number, first, {}
    if is_unit_row(names) and first - 1 in heads and not is_unit_row(_names(rows[first - 1])):
        begin = first - 1
        upper = _names(rows[begin])
        header, header_row = with_units(upper, names), rows[begin].number
        assumed["units"] = f"row {rows[first].number}, below the names"
        again: list[tuple[str, ...]] = [upper, names]
    else:
        again = [names]
    repeated = {k for k in heads if k > first and _names(rows[k]) in again}
    others = [rows[k].number for k in heads if k > first and k not in repeated]
    if others:
        raise RecordingError.of(
            f"{place}, row {', '.join(map(str, others[:5]))}",
            "another header in the middle of the list",
            allowed="one list in a sheet",
            next_step="put the second list into a sheet of its own",
        )
    below = [row for k, row in enumerate(rows) if k > first and k not in repeated]
    left_out = {AGAIN: len(repeated)} if repeated else {}
    return SheetTable(below, header, header_row, {**_above(rows[:begin]), **assumed}, left_out)


def _columns_of_numbers(rows: Sequence[Row]) -> set[int]:
    """Columns with a value in half of the rows that have any."""
    counts: Counter[int] = Counter()
    with_values = 0
    for row in rows:
        columns = [k for k, kind in enumerate(row.kinds) if kind in VALUES]
        counts.update(columns)
        with_values += bool(columns)
    return {column for column, count in counts.items() if 2 * count >= with_values}


def _is_head(row: Row, columns: set[int]) -> bool:
    """Whether a row is text alone, and has some over each of the columns."""
    if any(kind in VALUES for kind in row.kinds):
        return False
    return all(column < len(row.kinds) and row.kinds[column] == TEXT for column in columns)


def _names(row: Row) -> tuple[str, ...]:
    texts = [" ".join(text.split()) for text in row.texts]
    while texts and not texts[-1]:
        texts.pop()
    return tuple(texts)


def _above(rows: Sequence[Row]) -> dict[str, str]:
    """What stands above the list, in words."""
    if not rows:
        return {}
    numbers = [row.number for row in rows]
    shown = f"row {numbers[0]}" if len(numbers) == 1 else f"rows {numbers[0]} to {numbers[-1]}"
    text = " ".join(filter(None, rows[0].texts))
    return {"above the list": f"{shown}, not read: {text[:40]!r}" + (" ..." if len(numbers) > 1 else "")}
