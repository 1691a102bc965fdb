"""Reading what an instrument wrote, in any of the formats: recognised by the content, or as a person says."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

from compd.errors import Problem, RecordingError
from compd.files import without_values
from compd.instruments.cells import is_number
from compd.instruments.columns import to_export
from compd.instruments.export import InstrumentExport, ReadOptions
from compd.instruments.formats import instrument_formats
from compd.instruments.instrument_format import BinaryFormat, TextFormat
from compd.instruments.raw_table import RawTable
from compd.instruments.text_file import TextFile, decode_text, read_content
from compd.instruments.time_stamps import is_stamp
from compd.tables import ProblemList

_RECOGNISED_BY = 500
# Least share of numbers among a table's cells without dates; more than this share in a short table.
_MIN_SHARE = 1 / 2
_LONGER_ROWS = 3
_BETWEEN = re.compile(r"[;\t,]|\s+")
_COMMENT = ("#", "%", "//")


def is_table(lines: Sequence[str]) -> bool:
    """When a text counts as a table of measurements: before that, no message quotes anything of it.

    Whether most of the lines with a number in them have equally many cells, and many of the cells are numbers.
    """
    rows = [_BETWEEN.split(line.strip()) for line in lines[:_RECOGNISED_BY] if not line.lstrip().startswith(_COMMENT)]
    rows = [cells for cells in rows if any(map(is_number, cells))]
    if not rows:
        return False
    usual = Counter(map(len, rows)).most_common(1)[0][1]
    return 2 * usual > len(rows) and _has_numbers((cell for cells in rows for cell in cells), len(rows))


def is_of_numbers(columns: Sequence[Sequence[str]]) -> bool:
    """Whether many of the cells, column by column, are numbers."""
    rows = max(map(len, columns), default=0)
    return _has_numbers((cell for cells in columns for cell in cells[:_RECOGNISED_BY]), rows)


def no_table(path: Path) -> Problem:
    """The problem of a text that is none."""
    return Problem(
        str(path),
        "is no table of measurements",
        allowed="rows of numbers, with a header or without",
        next_step="give the path of the instrument's export",
    )


def _has_numbers(cells: Iterable[str], rows: int) -> bool:
    filled = [cell for cell in cells if cell and not is_stamp(cell)]
    numbers, least = sum(map(is_number, filled)), _MIN_SHARE * len(filled)
    return numbers > least or (numbers == least and rows >= _LONGER_ROWS)


# Lines at the top of a text among which the mark of a format stands.
_LOOKED_AT = 50


def read_export(path: Path, options: ReadOptions | None = None) -> InstrumentExport:
    """Read an instrument's export.

    Raises
    ------
    RecordingError
        Every problem with its line, and every question that only a person can answer, with the options that do.
    """
    options = options or ReadOptions()
    table = read_table(path, options)
    if isinstance(table, InstrumentExport):
        return table
    try:
        return to_export(table, options)
    except RecordingError:
        if is_of_numbers(table.columns):
            raise
        raise RecordingError(no_table(path)) from None


def read_table(path: Path, options: ReadOptions) -> RawTable | InstrumentExport:
    """As `read_export`, before it is known which column is what; a file without columns of text is read whole."""
    formats = instrument_formats()
    if options.shape is not None and options.shape not in formats:
        ProblemList(path).refuse(0, "--as names no shape", options.shape, ", ".join(formats))
    content = read_content(path)
    chosen = binary_format_of(path, content) if options.shape is None else formats[options.shape]
    if isinstance(chosen, BinaryFormat):
        return chosen.read(path, options)
    text = decode_text(path, content, options.limits)
    try:
        text_format = chosen if isinstance(chosen, TextFormat) else _text_format_of(text)
        return text_format.read(text, options)
    except RecordingError as error:
        if is_table(text.lines):
            raise
        raise RecordingError(without_values(error.problems)) from None


def binary_format_of(path: Path, content: bytes) -> BinaryFormat | None:
    """The format by the first bytes; None for text. Raises RecordingError for an outdated file."""
    for known in instrument_formats().values():
        if not isinstance(known, BinaryFormat):
            continue
        if content.startswith(known.magic):
            return known
        for magic, outdated in known.outdated.items():
            if content.startswith(magic):
                ProblemList(path).refuse(0, outdated.what, next_step=outdated.next_step)
    return None


def _text_format_of(text: TextFile) -> TextFormat:
    """The format whose mark stands at the top; else the first without a mark: `read_delimited` tells these apart."""
    known = [declared for declared in instrument_formats().values() if isinstance(declared, TextFormat)]
    top = text.lines[:_LOOKED_AT]
    for declared in filter(lambda declared: declared.mark, known):
        mark = re.compile(declared.mark, re.IGNORECASE)
        if any(map(mark.search, top)):
            return declared
    return next(declared for declared in known if not declared.mark)
