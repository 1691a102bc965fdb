"""What is wrong with an instrument's export, collected so that a person is told all of it at once."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from compd.errors import Problem, RecordingError

# Most lines, and values, listed in a message.
SHOWN = 3
_VALUE_WIDTH = 60


class ExportProblems:
    """Problems of one file.

    Attributes
    ----------
    path : the file. problems : so far.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.problems: list[Problem] = []

    def add(self, line: int, what: str, value: str = "", allowed: str = "", next_step: str = "") -> None:
        """Add a problem at a line of the file, or a row of the sheet, from 1; 0 for the file as a whole."""
        where = f"{self.path}:{line}" if line else str(self.path)
        value = value if len(value) <= _VALUE_WIDTH else value[: _VALUE_WIDTH - 3] + "..."
        self.problems.append(Problem(where, what, value=value, allowed=allowed, next_step=next_step))

    def ask(self, what: str, value: str, answers: Sequence[str], line: int = 0) -> None:
        """Add a question: several readings are possible, and each of `answers` settles it."""
        where = f"{self.path}:{line}" if line else str(self.path)
        self.problems.append(Problem(where, what, value=value, allowed=" or ".join(answers), next_step="say which"))

    def check(self) -> None:
        """Raise RecordingError if there is a problem."""
        if self.problems:
            raise RecordingError(self.problems)


def lines_text(lines: Sequence[int]) -> str:
    """Lines for a person: "line 5", "lines 5, 9 and 12", "lines 5, 9, 12 and 4 more"."""
    shown = [str(line) for line in lines[:SHOWN]]
    if len(lines) == 1:
        return f"line {shown[0]}"
    if len(lines) <= SHOWN:
        return f"lines {', '.join(shown[:-1])} and {shown[-1]}"
    return f"lines {', '.join(shown)} and {len(lines) - SHOWN} more"
