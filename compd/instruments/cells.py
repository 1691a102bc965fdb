"""Cells of an export: which are numbers, with which decimal mark, and what they are worth."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.reading import stands_for_no_number
from compd.tables import ProblemList, plain_numbers

NUMBER = re.compile(r"[-+]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][-+]?\d+)?", re.ASCII)
_WITH_THOUSANDS = re.compile(r"[-+]?\d{1,3}(?:[.,' ]\d{3})+(?:[.,]\d+)?", re.ASCII)
# A comma that must be decimal: not three digits behind it, or four or more or a single 0 before it.
_SURELY_DECIMAL = re.compile(
    r"^[-+]?(?:\d*,(?:\d{0,2}|\d{4,})|(?:0|\d{4,})?,\d{3})(?:[eE][-+]?\d+)?$|^[-+]?\d*,\d*[eE]", re.ASCII | re.MULTILINE
)
# Largest plausible length or time in any unit.
LARGEST = 1e30
OTHER_CHARACTERS = re.compile(r"[^0-9+\-.,eE]")
_TWO_MARKS, _POINT, _COMMA = re.compile(r"[.,][^\n.,]*[.,]"), re.compile(r"\."), re.compile(",")
# A column is numeric if at least this fraction of its first cells is; its other cells are then refused.
_SHARE = 0.5
_LOOKED_AT = 500


def is_number(cell: str) -> bool:
    """Whether a cell is one number, with a point or a comma."""
    return NUMBER.fullmatch(cell) is not None or _WITH_THOUSANDS.fullmatch(cell) is not None


def is_number_column(cells: Sequence[str]) -> bool:
    """Whether nearly all of the first cells with something in them are numbers."""
    filled = [cell for cell in cells[:_LOOKED_AT] if cell]
    return bool(filled) and sum(map(is_number, filled)) >= _SHARE * len(filled)


def decimal_mark(
    columns: Sequence[Sequence[str]], line: IntArray, wanted: str | None, problems: ProblemList
) -> tuple[str, str]:
    """The decimal mark, "." or ",", of columns of numbers, and in words how it is known.

    A problem is added where both are used, where numbers have marks of thousands, and where "1,234" may be either.
    wanted : as a person said; None to find out.
    """
    joined = ["\n".join(cells) for cells in columns]
    commas = [text for text in joined if "," in text]
    if not commas and wanted is None:
        # "1.234" alone is not asked about: programs that write thousands with a point write decimals with a comma
        return ".", "no number has a comma"
    if wanted is not None:
        _refuse_other_marks(columns, line, wanted, problems)
        return wanted, "given"
    for text in joined:
        row, cell = _first_with(_TWO_MARKS, text)
        if cell:
            problems.add(
                int(line[row]),
                "a number has marks of thousands",
                cell,
                "1234.5 or 1234,5",
                "say which mark is the decimal one with --decimal",
            )
            return ".", ""
    pointed = next((text for text in joined if "." in text), "")
    if any(map(_SURELY_DECIMAL.search, commas)):
        if pointed:
            row, cell = _first_with(_POINT, pointed)
            problems.add(
                int(line[row]),
                "a number has a point, where others have a decimal comma",
                cell,
                "one decimal mark in the whole file",
                "export with one decimal mark",
            )
        return ",", "no mark of thousands stands so"
    row, cell = _first_with(_COMMA, commas[0])
    if pointed:
        problems.add(
            int(line[row]),
            "numbers have points and commas",
            cell,
            "one decimal mark in the whole file",
            "say with --decimal which mark it is; the other one is then of thousands",
        )
    else:
        problems.ask(
            "ambiguous decimal separator: every comma is followed by three digits",
            cell,
            [f"--decimal , ({cell.replace(',', '.')})", f"--decimal . ({cell.replace(',', '')})"],
            int(line[row]),
        )
    return ".", ""


def _first_with(marks: re.Pattern[str], joined: str) -> tuple[int, str]:
    """(row, cell) of the first of the cells, joined by line ends, that has these marks; (0, "") for none."""
    found = marks.search(joined)
    if found is None:
        return 0, ""
    row = joined.count("\n", 0, found.start())
    begin = joined.rfind("\n", 0, found.start()) + 1
    return row, joined[begin:].partition("\n")[0]


def _refuse_other_marks(columns: Sequence[Sequence[str]], line: IntArray, decimal: str, problems: ProblemList) -> None:
    """Add a problem for the first number in which the mark that is not the decimal one is no mark of thousands."""
    other = "." if decimal == "," else ","
    grouped = re.compile(rf"[-+]?\d{{1,3}}(?:\{other}\d{{3}})+(?:\{decimal}\d*)?", re.ASCII)
    for cells in columns:
        joined = "\n".join(cells)
        if other not in joined and not _TWO_MARKS.search(joined):
            continue
        for i, cell in enumerate(cells):
            if (other in cell or cell.count(decimal) > 1) and not grouped.fullmatch(cell):
                problems.add(
                    int(line[i]),
                    f"is no number with {decimal} as its decimal mark",
                    cell,
                    f"1234{decimal}5",
                    "give another --decimal, or none",
                )
                return


def with_points(cells: Sequence[str], decimal: str) -> list[str]:
    """The cells with "." as their decimal mark, and without marks of thousands."""
    other = "." if decimal == "," else ","
    return "\n".join(cells).replace(other, "").replace(decimal, ".").split("\n")


def numbers(cells: Sequence[str], line: IntArray, what: str, problems: ProblemList) -> FloatArray:
    """(N,) the cells as floats, nan for empty ones. Adds a problem for each that is no number.

    line : (N,) of the cells. what : the column's content in words.
    """
    values = plain_numbers(cells)
    if values is not None:
        _check_size(values, cells, line, what, problems)
        return values
    wrong = [i for i, cell in enumerate(cells) if cell and not (NUMBER.fullmatch(cell) and "," not in cell)]
    for i in wrong[:3]:
        last = f" ({len(wrong)} cells like this)" if len(wrong) > 1 else ""
        problems.add(
            int(line[i]), f"{what} is no number{last}", cells[i], "a number, or nothing where nothing was measured"
        )
    skipped = set(wrong)
    values = np.array(
        [np.nan if i in skipped or not cell else float(cell) for i, cell in enumerate(cells)], dtype=np.float64
    )
    _check_size(values, cells, line, what, problems)
    return values


def _check_size(values: FloatArray, cells: Sequence[str], line: IntArray, what: str, problems: ProblemList) -> None:
    """Empty the cells that stand for no number, such as 9.9E37. Add a problem for other numbers that are too large."""
    large = np.flatnonzero(np.abs(values) > LARGEST)
    values[[i for i in large.tolist() if stands_for_no_number(values[i])]] = np.nan
    beyond = np.flatnonzero(np.abs(values) > LARGEST)
    if len(beyond):
        problems.add(int(line[beyond[0]]), f"{what} is larger than anything measured", cells[int(beyond[0])])
        values[beyond] = np.nan
