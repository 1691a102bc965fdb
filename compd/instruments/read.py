"""Reading what an instrument wrote, in any of the formats: recognised by the content, or as a person says."""

from __future__ import annotations

import re
from pathlib import Path

from compd.errors import RecordingError
from compd.files import without_values
from compd.instruments.columns import to_export
from compd.instruments.export import InstrumentExport, ReadOptions
from compd.instruments.formats import instrument_formats
from compd.instruments.instrument_format import BinaryFormat, TextFormat
from compd.instruments.raw_table import RawTable
from compd.instruments.recognition import is_of_numbers, is_table, no_table
from compd.instruments.text_file import TextFile, decode_text, read_content
from compd.tables import ProblemList

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
