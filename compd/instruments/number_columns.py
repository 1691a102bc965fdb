"""The numbers of any table, with the names of its columns: of a machine's own log, whose columns have no roles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from compd.arrays import FloatArray, IntArray, TextArray
from compd.instruments.cells import is_number_column, numbers
from compd.instruments.column_roles import Roles, column_text
from compd.instruments.columns import read_time
from compd.instruments.export import InstrumentExport, ReadOptions
from compd.instruments.raw_table import RawTable
from compd.instruments.read import read_table
from compd.instruments.time_stamps import StampedTime, check_rising
from compd.tables import ProblemList


@dataclass(frozen=True, eq=False)
class NumberColumns:
    """N rows of a table with C columns.

    header : (C,) names; "column 3" where the table has none, or has one twice.
    numbers : (C,) whether a column has numbers.
    line : (N,) line of the file, or row of the sheet.
    shape, taken : name of the format, and in words what was found.
    problems : with what was read so far.
    """

    path: Path
    header: tuple[str, ...]
    numbers: tuple[bool, ...]
    line: IntArray
    shape: str
    taken: Mapping[str, str]
    problems: ProblemList
    _table: RawTable = field(repr=False)

    @classmethod
    def of(cls, table: RawTable) -> NumberColumns:
        """Those of a table. Raises RecordingError where it has no rows of numbers."""
        problems = ProblemList(table.path)
        names = table.header or ("",) * len(table.columns)
        header = tuple(
            name if name and names.count(name) == 1 else f"column {k}" for k, name in enumerate(names, start=1)
        )
        of_numbers = tuple(map(is_number_column, table.columns))
        if not any(of_numbers) or not len(table.line):
            problems.add(table.header_line, "has no rows of numbers", allowed="a column of numbers, and a row")
        problems.check()
        return cls(table.path, header, of_numbers, table.line, table.shape, table.assumed, problems, table)

    def anew(self) -> NumberColumns:
        """The same, without problems so far."""
        return self.of(self._table)

    def values(self, column: int) -> FloatArray:
        """(N,) numbers of a column, nan for an empty cell; a problem is added for each cell that is no number."""
        return numbers(self._table.columns[column], self.line, self.header[column], self.problems)

    def texts(self, column: int) -> TextArray:
        """(N,) texts of a column, "" for an empty cell."""
        return np.array(self._table.columns[column], dtype=object)

    def time(self, column: int, unit: str, options: ReadOptions) -> StampedTime | None:
        """Times of a column of stamps, or of numbers in `unit`, as those of an export; None with a problem.

        unit : of numbers; "" where nobody says it.
        """
        roles = Roles()
        roles.take("time", column, unit, "")
        option = f'--log "{self.header[column]}=time_s:{{unit}}"'
        time = read_time(self._table, roles, options, self.problems, unit_option=option)
        if time is not None and not self.problems.problems:
            known = np.isfinite(time.time_s)
            check_rising(time.time_s[known], self.line[known], "sort or mend the rows", self.problems)
        return time

    def column_text(self, column: int) -> str:
        """A column for a person: "column 4 'X [mm]'"."""
        return column_text(self._table, column)


def read_number_columns(path: Path, options: ReadOptions | None = None) -> NumberColumns:
    """Read a workbook or a delimited text.

    Raises RecordingError where the file is no table, or has no rows of numbers.
    """
    table = read_table(path, options or ReadOptions())
    if isinstance(table, InstrumentExport):
        ProblemList(path).refuse(0, "is no table of columns", allowed="a workbook, or text with a delimiter")
    return NumberColumns.of(table)
