"""A spreadsheet with living formulas: written as .xlsx, each with the value that it has now.

The value of a formula is computed here too, so that the file shows numbers in programs that do not compute, and tests
can compare them with compd's. Formulas are of the small language below, which LibreOffice and Excel share.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import xlsxwriter
from scipy.special import gammaln
from scipy.stats import chi2
from scipy.stats import f as f_distribution

Value: TypeAlias = float | str

_QUOTED = re.compile(r'("[^"]*")')
_REFERENCE = re.compile(r"(?:([A-Z][a-z]+)!)?\$?([A-Z]{1,2})\$?(\d+)(?::\$?([A-Z]{1,2})\$?(\d+))?(?![(\w])")
_EQUALS = re.compile(r"(?<![<>=])=(?!=)")


class Address(NamedTuple):
    """A cell: its sheet, row and column, both counted from 1."""

    sheet: str
    row: int
    column: int

    def __str__(self) -> str:
        """As a formula on any sheet writes it: Folds!$C$7."""
        return f"{self.sheet}!${column_letters(self.column)}${self.row}"


def column_letters(column: int) -> str:
    """1 -> "A", 27 -> "AA"."""
    letters = ""
    while column:
        column, digit = divmod(column - 1, 26)
        letters = chr(ord("A") + digit) + letters
    return letters


def column_number(letters: str) -> int:
    """ "AA" -> 27."""
    number = 0
    for letter in letters:
        number = 26 * number + ord(letter) - ord("A") + 1
    return number


@dataclass(eq=False)
class Spreadsheet:
    """Sheets of cells, each a number, a text, or a formula that begins with "=".

    An example::

        >>> book = Spreadsheet()
        >>> book.put("Rows", 1, 1, [3.0, 4.0])
        >>> book.put("Rows", 2, 1, ["=SQRT(SUMPRODUCT(A1:B1,A1:B1))"])
        >>> book.value(Address("Rows", 2, 1))
        5.0
    """

    sheets: dict[str, dict[tuple[int, int], Value]] = field(default_factory=dict)
    _values: dict[Address, Value] = field(default_factory=dict)
    _bold: set[Address] = field(default_factory=set)

    def put(self, sheet: str, row: int, column: int, values: Iterable[Value], bold: bool = False) -> None:
        """Write values into one row, from a column on; the values of all formulas are computed anew."""
        cells = self.sheets.setdefault(sheet, {})
        for index, value in enumerate(values, start=column):
            cells[row, index] = value
            if bold:
                self._bold.add(Address(sheet, row, index))
        self._values.clear()

    def value(self, address: Address) -> Value:
        """What a cell shows; 0 of an empty one."""
        if address not in self._values:
            content = self.sheets[address.sheet].get((address.row, address.column), 0.0)
            is_formula = isinstance(content, str) and content.startswith("=")
            self._values[address] = self._computed(str(content), address.sheet) if is_formula else content
        return self._values[address]

    def number(self, address: Address) -> float:
        """What a cell shows, as a number."""
        return float(self.value(address))

    def save(self, path: Path, widths: dict[str, float], wide: float = 11.0) -> None:
        """Write the file; widths : of the first column of some sheets, in characters; wide : of every other one."""
        with xlsxwriter.Workbook(path) as book:
            heading = book.add_format({"bold": True, "text_wrap": True, "valign": "top"})
            computed = book.add_format({"font_color": "#0b5394"})
            for name, cells in self.sheets.items():
                page = book.add_worksheet(name)
                page.set_column(0, 60, wide)
                page.set_column(0, 0, widths.get(name, wide))
                for (row, column), content in cells.items():
                    address = Address(name, row, column)
                    style = heading if address in self._bold else None
                    if isinstance(content, str) and content.startswith("="):
                        page.write_formula(row - 1, column - 1, content, style or computed, self.value(address))
                    else:
                        page.write(row - 1, column - 1, content, style)

    def _computed(self, formula: str, sheet: str) -> Value:
        """The value of a formula on a sheet."""
        parts = _QUOTED.split(formula[1:])
        expression = "".join(part if k % 2 else self._translated(part, sheet) for k, part in enumerate(parts))
        # the formulas are those of docs/worked_example
        value = eval(expression, {"__builtins__": {}, "_cells": self._cells, **_FUNCTIONS})
        return value if isinstance(value, str) else float(value)

    def _translated(self, part: str, sheet: str) -> str:
        part = _EQUALS.sub("==", part.replace("<>", "!=")).replace("^", "**")

        def cells(match: re.Match[str]) -> str:
            other, left, top, right, bottom = match.groups()
            first = (int(top), column_number(left))
            last = (int(bottom), column_number(right)) if right else None
            return f"_cells({(other or sheet)!r}, {first}, {last})"

        return _REFERENCE.sub(cells, part)

    def _cells(self, sheet: str, first: tuple[int, int], last: tuple[int, int] | None) -> Any:
        """The value of a cell, or an array of those of a range, row by row."""
        if last is None:
            return self.value(Address(sheet, *first))
        rows, columns = range(first[0], last[0] + 1), range(first[1], last[1] + 1)
        return np.array([self.value(Address(sheet, row, column)) for row in rows for column in columns])


def _sumproduct(*arrays: Any) -> float:
    return float(np.sum(np.prod([np.asarray(array, dtype=np.float64) for array in arrays], axis=0)))


def _match(value: Value, values: Any, kind: float) -> float:
    """The place of a value, from 1; kind 0: the exact one."""
    return float(np.flatnonzero(values == value)[0]) + 1


_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "ABS": np.abs,
    "AND": lambda *conditions: all(conditions),
    "CHIDIST": lambda x, dof: float(chi2.sf(x, dof)),
    "COUNT": np.size,
    "EXP": math.exp,
    "FDIST": lambda x, dof1, dof2: float(f_distribution.sf(x, dof1, dof2)),
    "GAMMALN": lambda x: float(gammaln(x)),
    "IF": lambda condition, yes, no: yes if condition else no,
    "INDEX": lambda values, place: values[int(place) - 1],
    "LN": math.log,
    "MATCH": _match,
    "MAX": lambda *values: max(np.max(value) for value in values),
    "MIN": lambda *values: min(np.min(value) for value in values),
    "OR": lambda *conditions: any(conditions),
    "SQRT": math.sqrt,
    "SUM": lambda values: float(np.sum(values)),
    "SUMIF": lambda keys, key, values: float(np.sum(values[keys == key])),
    "SUMPRODUCT": _sumproduct,
}
