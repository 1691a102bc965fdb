"""Reading what an instrument wrote, whatever the shape: found by the first bytes, or as a person says."""

from __future__ import annotations

from pathlib import Path

from compd.errors import RecordingError
from compd.files import without_values
from compd.instruments.columns import to_export
from compd.instruments.delimited import read_delimited
from compd.instruments.export import SHAPES, InstrumentExport, ReadOptions
from compd.instruments.export_problems import ExportProblems
from compd.instruments.raw_table import RawTable
from compd.instruments.recognition import is_of_numbers, is_table, no_table
from compd.instruments.spatial_analyzer import is_spatial_analyzer, read_spatial_analyzer
from compd.instruments.text_file import decode_text, read_content

_WORKBOOK, _OLD_WORKBOOK, _CARTO = b"PK\x03\x04", b"\xd0\xcf\x11\xe0", b"HEADER::"


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
    """As `read_export`, before it is known which column is what; a CARTO file has no columns, and is read whole."""
    if options.shape is not None and options.shape not in SHAPES:
        problems = ExportProblems(path)
        problems.add(0, "--as names no shape", options.shape, ", ".join(SHAPES))
        raise RecordingError(problems.problems)
    content = read_content(path)
    shape = options.shape or _shape_of_bytes(path, content)
    if shape == "carto":
        from compd.instruments.carto import read_carto

        return read_carto(path, options)
    if shape == "xlsx":
        from compd.instruments.workbook import read_workbook

        return read_workbook(path, options)
    return _read_text(path, content, options)


def _shape_of_bytes(path: Path, content: bytes) -> str | None:
    """The shape of a file that is no text; None for text."""
    if content.startswith(_WORKBOOK):
        return "xlsx"
    if content.startswith(_CARTO):
        return "carto"
    if content.startswith(_OLD_WORKBOOK):
        problems = ExportProblems(path)
        problems.add(0, "is an Excel workbook of before 2007", next_step="save it as .xlsx, or as text")
        raise RecordingError(problems.problems)
    return None


def _read_text(path: Path, content: bytes, options: ReadOptions) -> RawTable:
    text = decode_text(path, content, options.limits)
    try:
        if options.shape == "sa" or (options.shape is None and is_spatial_analyzer(text)):
            return read_spatial_analyzer(text, options)
        return read_delimited(text, options)
    except RecordingError as error:
        if is_table(text.lines):
            raise
        raise RecordingError(without_values(error.problems)) from None
