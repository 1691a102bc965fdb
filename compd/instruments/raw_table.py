"""An export as a table of text, before it is known which column is what."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from compd.arrays import IntArray


@dataclass(frozen=True)
class RawTable:
    """The cells of an export, column by column.

    Attributes
    ----------
    path : the file. shape : name of its format.
    columns : (C) columns of (N,) cells each, stripped, "" where empty. A number has "." as its decimal mark already.
    line : (N,) line of the file, or row of the sheet, from 1.
    header : (C,) names of the columns; None if the file has none. header_line : its line; 0 without one.
    unit : of the lengths, where the file says it beside the columns' names ("mm", "m", "inch" ...); "" if not.
    decimal : "." or ",", as it was in the file.
    assumed : in words for a person, what was found: "delimiter" -> "semicolon", "decimal mark" -> "comma", ...
    roles : roles that the shape itself settles, by column; empty for any other column.
    left_out : reason -> rows that are not there.
    """

    path: Path
    shape: str
    columns: Sequence[Sequence[str]]
    line: IntArray
    header: tuple[str, ...] | None = None
    header_line: int = 0
    unit: str = ""
    decimal: str = "."
    assumed: Mapping[str, str] = field(default_factory=dict)
    roles: Sequence[str] = ()
    left_out: Mapping[str, int] = field(default_factory=dict)
