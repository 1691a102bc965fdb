"""Text with a delimiter, or with columns between blanks, as a table: comments, header, units and decimal mark found."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from compd.arrays import IntArray
from compd.instruments.cells import OTHER_CHARACTERS, decimal_mark, is_number, is_number_column, with_points
from compd.instruments.delimiter import BLANKS, NAMES, WIDE_BLANKS, find_delimiter, split_cells, split_header
from compd.instruments.export import ReadOptions
from compd.instruments.header_names import is_unit_row, with_units
from compd.instruments.raw_table import RawTable
from compd.instruments.read_limits import ReadLimits
from compd.instruments.text_file import TextFile
from compd.instruments.time_stamps import is_stamp
from compd.tables import ProblemList
from compd.units import unit_named

_COMMENT = ("#", "%", "//")
_MAY_BE_NO_ROW = "#%/"
_SEPARATOR_LINE = re.compile(r"sep=(.)\s*", re.IGNORECASE)
_UNIT_COMMENT = re.compile(r"\b(?:units?|einheit(?:en)?)\b\W*([^\W\d]+)", re.IGNORECASE)


@dataclass
class _Rows:
    """Lines of a table that are not split yet, with their numbers, and the comments between them."""

    rows: list[str] = field(default_factory=list)
    number: list[int] = field(default_factory=list)
    comments: list[tuple[int, str]] = field(default_factory=list)


def read_delimited(text: TextFile, options: ReadOptions, shape: str | None = None) -> RawTable:
    """The table in a text. Raises RecordingError with the lines that are not understood.

    shape : of the table; None for "csv" or "blanks", as the delimiter is.
    """
    problems = ProblemList(text.path)
    file_rows = _rows_and_comments(text.lines)
    delimiter = _take_delimiter(file_rows, options)
    if not file_rows.rows:
        problems.add(0, "has no rows", f"{len(file_rows.comments)} lines of comments", "rows of numbers")
    problems.check()
    # a delimiter at the end of every line is the end of its last cell
    if delimiter.strip() and all(row.rstrip(" ").endswith(delimiter) for row in file_rows.rows[1:] or file_rows.rows):
        file_rows.rows = [row.rstrip(" ").removesuffix(delimiter) for row in file_rows.rows]
    count, above = _count_cells(file_rows, delimiter, problems)
    problems.check()
    _check_size(file_rows, count, options.limits, problems)
    columns, line = _split(file_rows, delimiter, count, above)
    header = _take_header(file_rows, columns, line, delimiter, count, above, problems)
    columns, line, left_out = _drop_headers(columns, line, header, problems)
    problems.check()
    number_columns = [k for k, cells in enumerate(columns) if is_number_column(cells)]
    _check_last_cell(text, columns, line, number_columns, problems)
    mark, why = decimal_mark([columns[k] for k in number_columns], line, options.decimal, problems)
    problems.check()
    for k in number_columns if mark == "," or options.decimal else ():
        columns[k] = with_points(columns[k], mark)
    assumed = {"encoding": text.encoding, "delimiter": NAMES[delimiter]}
    assumed["decimal mark"] = f"{'comma' if mark == ',' else 'point'}, {why}"
    assumed["header"] = f"line {header.line}" if header.names else "none"
    if header.above:
        assumed["not read"] = f"{header.above} line{'s' * (header.above != 1)} above the table"
    if file_rows.comments:
        assumed["comments"] = f"{len(file_rows.comments)} line{'s' * (len(file_rows.comments) != 1)}"
    return RawTable(
        path=text.path,
        shape=shape or ("blanks" if delimiter in (BLANKS, WIDE_BLANKS) else "csv"),
        columns=columns,
        line=line,
        header=header.names,
        header_line=header.line,
        unit=_unit_in_comments(file_rows, problems),
        decimal=mark,
        assumed=assumed,
        left_out=left_out,
    )


@dataclass(frozen=True)
class _Header:
    """The names of the columns, their units within; `rows`: how many rows at the top hold them or are above them."""

    names: tuple[str, ...] | None
    line: int
    rows: int
    above: int
    repeats: tuple[tuple[str, ...], ...] = ()


def _rows_and_comments(lines: Sequence[str]) -> _Rows:
    file_rows = _Rows()
    gone = set()
    # of a million lines few begin so; an empty line "begins" with any of them
    for i in [i for i, line in enumerate(map(str.lstrip, lines)) if line[:1] in _MAY_BE_NO_ROW]:
        stripped = lines[i].strip()
        if stripped.startswith(_COMMENT):
            file_rows.comments.append((i + 1, stripped))
        if not stripped or stripped.startswith(_COMMENT):
            gone.add(i)
    file_rows.rows = [line for i, line in enumerate(lines) if i not in gone]
    file_rows.number = [i for i in range(1, len(lines) + 1) if i - 1 not in gone]
    return file_rows


def _take_delimiter(file_rows: _Rows, options: ReadOptions) -> str:
    """The delimiter; lines with a semicolon in front become comments where it is none, empty rows are dropped."""
    if not file_rows.rows:
        return BLANKS
    separator = _SEPARATOR_LINE.fullmatch(file_rows.rows[0].strip())
    if separator and separator[1] in NAMES:
        del file_rows.rows[0], file_rows.number[0]
        delimiter = separator[1]
    else:
        table = [
            row for row, bare in zip(file_rows.rows, map(str.lstrip, file_rows.rows), strict=True) if bare[0] != ";"
        ]
        delimiter = find_delimiter(table, options.decimal) if table else ","
    if options.shape == "blanks" and delimiter not in (BLANKS, WIDE_BLANKS):
        delimiter = BLANKS
    if delimiter != ";":
        marked = [i for i, row in enumerate(map(str.lstrip, file_rows.rows)) if row[:1] == ";"]
        file_rows.comments += [(file_rows.number[i], file_rows.rows[i].strip()) for i in marked]
        file_rows.comments.sort()
        _drop(file_rows, marked)
    between = delimiter + " \t"
    _drop(file_rows, [i for i, row in enumerate(file_rows.rows) if row[0] in between and not row.strip(between)])
    return delimiter


def _drop(file_rows: _Rows, indices: Sequence[int]) -> None:
    if indices:
        gone = set(indices)
        file_rows.rows = [row for i, row in enumerate(file_rows.rows) if i not in gone]
        file_rows.number = [number for i, number in enumerate(file_rows.number) if i not in gone]


def _count_cells(file_rows: _Rows, delimiter: str, problems: ProblemList) -> tuple[int, int]:
    """Number of cells that most rows have, and how many lines of prose stand above the table."""
    if delimiter in (BLANKS, WIDE_BLANKS) or '"' in "".join(file_rows.rows):
        counts = [len(split_cells(row, delimiter)) for row in file_rows.rows]
    else:
        counts = [row.count(delimiter) + 1 for row in file_rows.rows]
    count = Counter(counts).most_common(1)[0][0]
    above = 0
    while above < len(counts) and counts[above] != count:
        cells = split_cells(file_rows.rows[above], delimiter)
        if len(cells) > 1 and any(map(is_number, cells)):
            break
        above += 1
    wrong = [i for i in range(above, len(counts)) if counts[i] != count]
    for i in wrong[:3]:
        last = "; the last line seems to be cut off" if i == len(counts) - 1 and counts[i] < count else ""
        more = f" ({len(wrong)} lines like this)" if len(wrong) > 1 and i == wrong[0] else ""
        problems.add(
            file_rows.number[i],
            f"has {_cells(counts[i])} where the others have {count}{last}{more}",
            file_rows.rows[i].strip(),
            f"{_cells(count)}, {NAMES[delimiter]} between them",
            "mend or delete the line",
        )
    return count, above


def _check_size(file_rows: _Rows, count: int, limits: ReadLimits, problems: ProblemList) -> None:
    """Raise RecordingError for more than a list may have, before it is split into cells."""
    rows = len(file_rows.rows)
    if count > limits.columns:
        step = "export one row of the table in a line, with the columns that are needed"
        problems.add(file_rows.number[0], "has too many columns", str(count), f"{limits.columns} in a line", step)
    elif rows * count > limits.cells:
        value = f"{rows} rows of {_cells(count)}, {rows * count} together"
        step = "leave out columns or samples, or split the file"
        problems.add(0, "has too many cells", value, f"{limits.cells} cells", step)
    problems.check()


def _cells(count: int) -> str:
    return f"{count} cell{'s' * (count != 1)}"


def _split(file_rows: _Rows, delimiter: str, count: int, above: int) -> tuple[list[list[str]], IntArray]:
    """The columns of the rows below the prose, and the lines that they are from."""
    rows = file_rows.rows[above:]
    line = np.array(file_rows.number[above:], dtype=np.int64)
    if delimiter == BLANKS:
        flat = " ".join(rows).split()
    elif delimiter == WIDE_BLANKS or '"' in "".join(rows):
        flat = [cell for row in rows for cell in split_cells(row, delimiter)]
    else:
        joined = delimiter.join(rows)
        flat = joined.split(delimiter)
        if " " in joined or "\t" in joined or "\xa0" in joined:
            flat = list(map(str.strip, flat))
    return [flat[k::count] for k in range(count)], line


def _take_header(
    file_rows: _Rows,
    columns: Sequence[Sequence[str]],
    line: IntArray,
    delimiter: str,
    count: int,
    above: int,
    problems: ProblemList,
) -> _Header:
    """The header among the rows without a number at the top, in the line above them, or in the last comment."""
    top = 0
    while top < len(line) and not any(is_number(cells[top]) or is_stamp(cells[top]) for cells in columns):
        top += 1
    if top == len(line):
        problems.add(int(line[0]), "no row has a number", file_rows.rows[above].strip(), "rows of numbers")
        return _Header(None, 0, 0, above)
    tops = [tuple(cells[i] for cells in columns) for i in range(top)]
    if not tops:
        return _header_above(file_rows, line, delimiter, count, above, problems)
    units = [i for i in range(1, top) if is_unit_row(tops[i])]
    named = [i for i in range(top) if i not in units]
    first = max(named, key=lambda i: (sum(map(bool, tops[i])), -i))
    names, last = tops[first], first + 1
    repeats = [names]
    if last in units:
        repeats.append(tops[last])
        names = with_units(names, tops[last])
        last += 1
    return _Header(names, int(line[first]), last, above + first, tuple(repeats))


def _header_above(
    file_rows: _Rows, line: IntArray, delimiter: str, count: int, above: int, problems: ProblemList
) -> _Header:
    """A header between other marks than the rows: with blanks in its names, or in a comment. None is refused, if it
    has another number of names than the rows have cells."""
    if above:
        names = split_header(file_rows.rows[above - 1], delimiter, count)
        if len(names) == count and file_rows.number[above - 1] < line[0]:
            return _Header(tuple(names), file_rows.number[above - 1], 0, above - 1)
        if len(names) > 1 and delimiter not in (BLANKS, WIDE_BLANKS):
            problems.add(
                file_rows.number[above - 1],
                f"the line above the rows has {_cells(len(names))}, the rows have {count}",
                file_rows.rows[above - 1].strip(),
                "a name for every column",
                "mend the header; where it is none, delete it or put # in front",
            )
    last = [(number, text) for number, text in file_rows.comments if number < line[0]][-1:]
    for number, text in last:
        # "#;X;Y" has a first column of numbers
        numbered = delimiter.strip() and text.startswith("#" + delimiter)
        bare = text if numbered else text.lstrip("#%/;").strip()
        names = split_header(bare, delimiter, count)
        # one column: any word would be its name
        if len(names) == count > 1 and not any(map(is_number, names)):
            file_rows.comments.remove((number, text))
            return _Header(tuple(names), number, 0, above)
    return _Header(None, 0, 0, above)


def _drop_headers(
    columns: list[list[str]], line: IntArray, header: _Header, problems: ProblemList
) -> tuple[list[list[str]], IntArray, dict[str, int]]:
    """The rows below the header, without its repeats; another header between them is refused."""
    columns, line = [cells[header.rows :] for cells in columns], line[header.rows :]
    probe = next((cells for cells in columns if len(line) and is_number(cells[0])), [])
    # a name has other characters than a number
    suspicious = OTHER_CHARACTERS.search("".join(probe)) is not None
    odd = [i for i, cell in enumerate(probe) if cell and not is_number(cell)] if suspicious else []
    again = set()
    for i in odd:
        row = tuple(cells[i] for cells in columns)
        if row in header.repeats:
            again.add(i)
        elif not any(is_number(cell) or is_stamp(cell) for cell in row):
            problems.add(
                int(line[i]),
                "another header begins here" if header.names else "a header stands between the rows",
                ", ".join(row),
                "one table with one header",
                "split the file here, or delete the line",
            )
            break
    if not again:
        return columns, line, {}
    kept = [i for i in range(len(line)) if i not in again]
    return [[cells[i] for i in kept] for cells in columns], line[kept], {"the header again": len(again)}


def _check_last_cell(
    text: TextFile,
    columns: Sequence[Sequence[str]],
    line: IntArray,
    number_columns: Sequence[int],
    problems: ProblemList,
) -> None:
    """Refuse a last line without an end whose last number has fewer decimals than every other: it is cut off."""
    last = len(columns) - 1
    if text.complete or last not in number_columns or len(line) < 3 or int(line[-1]) != len(text.lines):
        return

    def decimals(cell: str) -> int:
        return len(re.split(r"[.,]", cell)[1]) if re.search(r"[.,]", cell) else 0

    others = {decimals(cell) for cell in columns[last][:-1]}
    if len(others) == 1 and decimals(columns[last][-1]) < min(others):
        problems.add(
            int(line[-1]),
            "the last line seems to be cut off: its last number has fewer decimals than all others, and no line end",
            columns[last][-1],
            f"{min(others)} decimals",
            "delete the line, or end it",
        )


def _unit_in_comments(file_rows: _Rows, problems: ProblemList) -> str:
    """The unit of lengths that a comment names; "" for none. Two that differ are refused."""
    units: dict[str, int] = {}
    for number, text in file_rows.comments:
        for match in _UNIT_COMMENT.finditer(text):
            unit = unit_named(match[1])
            if unit in ("mm", "um", "nm", "cm", "m", "inch", "ft"):
                units.setdefault(unit, number)
    if len(units) > 1:
        problems.refuse(max(units.values()), "comments name two units", ", ".join(units), "one", "give --unit")
    return next(iter(units), "")
