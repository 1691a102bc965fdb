"""The problems of one file, and the wording of rows, values and columns in its messages."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NoReturn

from compd.errors import Problem, RecordingError

# Most rows, and different values, listed in a message.
SHOWN_ROWS = 3
# Longest part of a line of text that is quoted.
_LINE_WIDTH = 60


class ProblemList:
    """Faults of one file.

    A place is a line of a text file, from 1, or "row 5", "column scale_1_mm (E)"; 0 or "" is the file as a whole.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.problems: list[Problem] = []  #: with these the file cannot be used
        self.warnings: list[Problem] = []  #: it can, but a person should look

    def add(self, place: str | int, what: str, value: str = "", allowed: str = "", next_step: str = "") -> None:
        """Add a problem at a place in this file."""
        if isinstance(place, int) and len(value) > _LINE_WIDTH:
            value = value[: _LINE_WIDTH - 3] + "..."
        self.problems.append(Problem(self._where(place), what, value=value, allowed=allowed, next_step=next_step))

    def refuse(self, place: str | int, what: str, value: str = "", allowed: str = "", next_step: str = "") -> NoReturn:
        """Add a problem, and raise RecordingError with all."""
        self.add(place, what, value, allowed, next_step)
        raise RecordingError(self.problems)

    def ask(self, what: str, value: str, answers: Sequence[str], line: int = 0) -> None:
        """Add a question: several readings are possible, and each of `answers` settles it."""
        self.add(line, what, value, " or ".join(answers), "say which")

    def warn(self, place: str, what: str, value: str = "", allowed: str = "", next_step: str = "") -> None:
        """Add a warning, as `add` a problem."""
        self.warnings.append(Problem(self._where(place), what, value=value, allowed=allowed, next_step=next_step))

    def check(self) -> None:
        """Raise RecordingError if there is a problem."""
        if self.problems:
            raise RecordingError(self.problems)

    def _where(self, place: str | int) -> str:
        return f"{self.path}:{' ' * isinstance(place, str)}{place}" if place else str(self.path)


def rows_text(rows: Sequence[int], noun: str = "row") -> str:
    """Rows, or lines, for a person: "row 5", "rows 5, 9 and 12", "rows 5, 9, 12 and 412 more rows"."""
    shown = [str(row) for row in rows[:SHOWN_ROWS]]
    more = len(rows) - len(shown)
    if more:
        return f"{noun}s {', '.join(shown)} and {more} more {noun}{'s' * (more != 1)}"
    return f"{noun} {shown[0]}" if len(shown) == 1 else f"{noun}s {', '.join(shown[:-1])} and {shown[-1]}"


def values_text(values: Iterable[str]) -> str:
    """The first few offending values as written, each once."""
    different: list[str] = []
    for value in values:
        if value not in different:
            different.append(value)
        if len(different) > SHOWN_ROWS:  # enough of millions of values
            break
    shown = ", ".join(repr(value if len(value) <= 40 else value[:37] + "...") for value in different[:SHOWN_ROWS])
    return shown + (", ..." if len(different) > SHOWN_ROWS else "")


def column_letters(index: int) -> str:
    """The letters over column `index` (0-based) in a spreadsheet: 0 -> A, 26 -> AA."""
    letters = ""
    index += 1
    while index:
        index, rest = divmod(index - 1, 26)
        letters = chr(ord("A") + rest) + letters
    return letters
