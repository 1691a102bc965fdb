"""A recording's table from any kind of file: columns of numbers, and a spreadsheet's row numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray, IntArray, TextArray
from compd.tables.problem_list import ProblemList

# The header is row 1, also of a file that has none.
FIRST_ROW = 2


@dataclass(frozen=True)
class Table:
    """Columns of numbers of one file, or of a block of its rows."""

    path: Path  #: the file
    #: column name -> the letters over it in a spreadsheet, "" for a file that no spreadsheet shows; in order
    letters: Mapping[str, str]
    columns: dict[str, FloatArray]  #: name -> (N,) float64, nan where the cell is empty (or was reported as wrong)
    row: IntArray  #: (N,) the row as a spreadsheet numbers it; the header is row 1. Empty rows are left out.
    #: name -> the different texts of a column of ids, in the order of their codes in `columns`
    labels: dict[str, tuple[str, ...]] = field(default_factory=dict)
    wrong: frozenset[str] = frozenset()  #: names of columns with cells that were reported as wrong

    def place(self, name: str) -> str:
        """A column for a person: its name and the letters over it."""
        return f"column {name} ({self.letters[name]})" if self.letters.get(name) else f"column {name}"

    def texts(self, name: str) -> Sequence[str]:
        """(N,) a column as text, "" where it is empty or missing."""
        if name not in self.columns:
            return [""] * len(self.row)
        if name in self.labels:
            return list(id_texts(self.columns[name], self.labels[name]))
        return ["" if np.isnan(value) else f"{value:.15g}" for value in self.columns[name]]

    def select(self, index: IntArray) -> Table:
        """The rows of this index (R,), copied."""
        return replace(
            self, columns={name: values[index] for name, values in self.columns.items()}, row=self.row[index]
        )

    def extended_by(self, *later: Table) -> Table:
        """These rows followed by those of later blocks of the same file."""
        parts = (self, *later)
        columns = {name: np.concatenate([part.columns[name] for part in parts]) for name in self.columns}
        return replace(self, columns=columns, row=np.concatenate([part.row for part in parts]))


class TableBlock(NamedTuple):
    """Some rows of a table with the faults found while reading. table : None without any table."""

    table: Table | None
    problems: ProblemList


def id_labels(cells: Iterable[str]) -> tuple[str, ...]:
    """The different texts of a column of ids, in sorted order."""
    return tuple(sorted({cell for cell in cells if cell}))


def id_codes(cells: Sequence[str], labels: Sequence[str]) -> FloatArray:
    """(N,) each cell's index among `labels`, nan where it is empty."""
    code = {label: float(i) for i, label in enumerate(labels)}
    return np.array([code.get(cell, np.nan) for cell in cells], dtype=np.float64)


def id_texts(codes: FloatArray, labels: Sequence[str]) -> TextArray:
    """(N,) the text of each code, "" for nan: what `id_codes` read."""
    return np.array(["" if np.isnan(code) else labels[int(code)] for code in codes.tolist()], dtype=object)
