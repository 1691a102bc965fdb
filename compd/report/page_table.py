"""A table of texts, as pages and terminals show it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class PageTable:
    """Rows of text under a head; the first column names the row."""

    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str = ""

    @property
    def numeric(self) -> list[bool]:
        """Whether each column holds numbers only, which are aligned on the right."""
        columns = zip(*self.rows, strict=True) if self.rows else [()] * len(self.head)
        return [all(map(_is_number, column)) for column in columns]


def _is_number(cell: str) -> bool:
    """Whether the text is a number, with or without a unit, or stands for an unknown one."""
    return cell in ("", "-") or cell[0].isdigit() or (cell[0] in "+-." and cell[1:2].isdigit())
