"""The numbers of any table, with the names of its columns: of a machine's own log, whose columns have no roles."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from compd.arrays import FloatArray
from compd.errors import RecordingError
from compd.instruments.cells import is_number_column, numbers
from compd.instruments.export import InstrumentExport, ReadOptions
from compd.instruments.export_problems import ExportProblems
from compd.instruments.read import read_table


@dataclass(frozen=True)
class NumberColumns:
    """K columns of numbers.

    names : (K) as the header has them; "column 3" without a header.  values : (N, K), nan for an empty cell.
    """

    path: Path
    names: tuple[str, ...]
    values: FloatArray


def read_number_columns(path: Path, options: ReadOptions | None = None) -> NumberColumns:
    """Read a workbook or a delimited text: the columns of numbers; others, such as names and stamps, are left out.

    Raises RecordingError where the file is no table, or has no rows of numbers.
    """
    table = read_table(path, options or ReadOptions())
    problems = ExportProblems(path)
    if isinstance(table, InstrumentExport):
        problems.add(0, "is no table of columns", allowed="a workbook, or text with a delimiter")
        raise RecordingError(problems.problems)
    header = table.header or tuple(f"column {k + 1}" for k in range(len(table.columns)))
    chosen = [k for k, cells in enumerate(table.columns) if is_number_column(cells)]
    columns = [numbers(table.columns[k], table.line, header[k], problems) for k in chosen]
    if not columns or not len(table.line):
        problems.add(table.header_line, "has no rows of numbers", allowed="a column of numbers, and a row")
    problems.check()
    return NumberColumns(path, tuple(header[k] for k in chosen), np.stack(columns, axis=1))
