"""How much an export may hold: checked as it is read, before the memory is spent."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ReadLimits:
    """What one export may hold; the defaults are generous, for a person's own files."""

    columns: int = 500  #: in a line
    line_characters: int = 100_000  #: of one line
    lines: int = 10_000_000  #: of a text
    cells: int = 100_000_000  #: of a text, rows times columns
    #: of a sheet and of the workbook's table of texts. Each takes much longer than one of a text.
    sheet_cells: int = 20_000_000
    #: of a workbook, which is a compressed file. A full sheet of a million rows has 300 MB.
    unpacked_bytes: int = 1_000_000_000


GENEROUS = ReadLimits()
