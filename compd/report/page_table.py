"""A table of texts, as pages and terminals show it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class PageTable:
    """Rows of text under a head; the first column is what the row is about."""

    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str = ""

    @property
    def numeric(self) -> list[bool]:
        """For each column, whether it holds only numbers, which are aligned on the right."""
        columns = zip(*self.rows, strict=True) if self.rows else [()] * len(self.head)
        return [all(map(_is_number, column)) for column in columns]


def _is_number(cell: str) -> bool:
    """Whether the text begins as a number does, with or without a unit behind it; or nothing is known."""
    return cell in ("", "-") or cell[0].isdigit() or (cell[0] in "+-." and cell[1:2].isdigit())
