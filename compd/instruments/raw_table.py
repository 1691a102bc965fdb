"""An export as a table of text, before it is known which column is what."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from compd.arrays import IntArray


@dataclass(frozen=True)
class RawTable:
    """The cells of an export, column by column."""

    path: Path  #: the file
    shape: str  #: name of its format
    #: (C) columns of (N,) cells each, stripped, "" where empty. A number has "." as its decimal mark already.
    columns: Sequence[Sequence[str]]
    line: IntArray  #: (N,) line of the file, or row of the sheet, from 1
    header: tuple[str, ...] | None = None  #: (C,) names of the columns; None if the file has none
    header_line: int = 0  #: its line; 0 without one
    #: of the lengths, where the file says it beside the columns' names ("mm", "m", "inch" ...); "" if not.
    unit: str = ""
    decimal: str = "."  #: "." or ",", as it was in the file.
    #: in words for a person, what was found: "delimiter" -> "semicolon", "decimal mark" -> "comma", ...
    assumed: Mapping[str, str] = field(default_factory=dict)
    roles: Sequence[str] = ()  #: roles that the shape itself settles, by column; empty for any other column
    left_out: Mapping[str, int] = field(default_factory=dict)  #: reason -> rows that are not there
