"""The sheets of the worked example: their columns by name, and where the main results stand."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from docs.worked_example.example import Example
from docs.worked_example.spreadsheet import Address, Spreadsheet, column_letters

# First row of the data on every sheet that has one row for each row of the recording.
FIRST = 3
AXES = "xyz"
# Sets of effects: the letters of their columns.
SETS = {"0": "", "a": "a", "ab": "ab", "c": "c"}


class Sheets:
    """The spreadsheet of an example; `results` and `criteria` say where its main results and the criteria stand."""

    def __init__(self, example: Example) -> None:
        self.example = example
        self.book = Spreadsheet()
        self.results: dict[str, Address] = {}
        self.criteria: dict[str, Address] = {}
        self.last_row = FIRST + len(example.problem.known) - 1
        self._letters: dict[tuple[str, str], str] = {}

    def save(self, path: Path) -> None:
        """Write the spreadsheet as .xlsx."""
        self.book.save(path, {"Readme": 100.0, "Criteria": 24.0, "Folds": 20.0, "Blocks": 22.0, "Verdict": 44.0})

    def table(self, sheet: str, about: str, names: list[str], rows: Iterable[Sequence[float | str]]) -> None:
        """A sheet with one line about it, names, and rows from row FIRST on."""
        self.book.put(sheet, 1, 1, [about])
        self.book.put(sheet, 2, 1, names, bold=True)
        self._letters |= {(sheet, name): column_letters(index) for index, name in enumerate(names, start=1)}
        for row, values in enumerate(rows, start=FIRST):
            self.book.put(sheet, row, 1, values)

    def column(self, sheet: str, name: str) -> str:
        """A column of a sheet with one row for each row of the recording, as formulas write it."""
        letter = self._letters[sheet, name]
        return f"{sheet}!${letter}${FIRST}:${letter}${self.last_row}"

    def cell(self, sheet: str, name: str, row: int) -> str:
        """One cell of such a column, as formulas write it."""
        return f"{sheet}!{self._letters[sheet, name]}{row}"
