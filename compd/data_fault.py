"""What is wrong with data whatever the model is: rows or cells that no machine can have made, in words."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from compd.text import join_words

# What becomes of the rows that a fault names.
Consequence = Literal["rows left out", "cells empty", "used", "mend the column"]
_CONSEQUENCES: dict[Consequence, str] = {
    "rows left out": "not used",
    "cells empty": "taken as empty",
    "mend the column": "used as it stands; mend the column",
    "used": "used as it stands; look, and leave it out if it is wrong",
}
# Stretches of rows that a sentence names.
_MAX_STRETCHES = 4


@dataclass(frozen=True)
class DataFault:
    """Rows of a recording whose data are wrong, or look so.

    reason : in few words, for counts of rows: "the reference repeats itself".
    rows : as a spreadsheet shows them, rising; empty where all are meant.
    columns : of the cells that are meant; empty for whole rows.
    what : what the cells show, as the predicate of the column, or of `the reference` where there are several.
    consequence : whether the rows do not count, or the cells only, or a person is asked.
    """

    reason: str
    rows: tuple[int, ...]
    columns: tuple[str, ...]
    what: str
    consequence: Consequence

    def without(self, rows: Collection[int]) -> DataFault | None:
        """The fault without some rows; None where no row is left."""
        left = tuple(row for row in self.rows if row not in rows)
        return replace(self, rows=left) if left else None

    @property
    def text(self) -> str:
        """The fault in a sentence: where, what, and what becomes of it."""
        kinds = {name.partition("_")[0] for name in self.columns}
        whole = len(self.columns) > 1 and len(kinds) == 1
        subject = f"the {kinds.pop()} " if whole else "".join(f"{name} " for name in self.columns)
        where = f"{stretches_text(self.rows)}: " if self.rows else ""
        return f"{where}{subject}{self.what} ({_CONSEQUENCES[self.consequence]})"


def stretches_text(rows: Sequence[int]) -> str:
    """Rising rows for a person: "row 5", "rows 102 to 141", "rows 5, 9 to 12 and 7 more"."""
    stretches = row_stretches(rows)
    shown = [str(first) if first == last else f"{first} to {last}" for first, last in stretches[:_MAX_STRETCHES]]
    more = sum(last - first + 1 for first, last in stretches[_MAX_STRETCHES:])
    return f"row{'s' * (len(rows) > 1)} {join_words([*shown, *([f'{more} more'] if more else [])])}"


def row_stretches(rows: Collection[int]) -> list[tuple[int, int]]:
    """First and last row of each stretch without a gap."""
    stretches: list[tuple[int, int]] = []
    for row in sorted(rows):
        if stretches and row == stretches[-1][1] + 1:
            stretches[-1] = (stretches[-1][0], row)
        else:
            stretches.append((row, row))
    return stretches
