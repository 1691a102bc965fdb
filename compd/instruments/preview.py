"""The first rows of an export with what each column is taken for: what a person checks before it is used."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path

from compd.errors import Problem, RecordingError
from compd.instruments.column_roles import find_roles
from compd.instruments.columns import group_labels, to_export
from compd.instruments.export import InstrumentExport, ReadOptions
from compd.instruments.formats import instrument_formats
from compd.instruments.instrument_format import BinaryFormat, InstrumentFormat
from compd.instruments.raw_table import RawTable
from compd.instruments.read import binary_format_of, read_table
from compd.instruments.read_limits import ReadLimits
from compd.instruments.text_file import decode_text, read_content
from compd.tables import ProblemList

SHOWN_ROWS = 20
# Longer lines and cells, more columns and groups than these are not shown whole.
_CELL_WIDTH = 200
_MAX_COLUMNS = 200
_MAX_GROUPS = 200


@dataclass(frozen=True)
class ExportPreview:
    """The top of an export."""

    export: InstrumentExport | None  #: the whole of it; None where `problems` say why it cannot be read
    shape: str = ""  #: name of its format; "" where it is not known
    line: Sequence[int] = ()  #: of each row that is shown
    rows: Sequence[Sequence[str]] = ()  #: their cells, one text in each where no columns could be told
    header: Sequence[str] = ()  #: (C,) names of the columns; empty where they have none
    roles: Sequence[str] = ()  #: (C,) what each is taken for, "-" for nothing; empty where no columns could be told
    assumed: Mapping[str, str] = field(default_factory=dict)  #: what was found, in words
    groups: Sequence[str] = ()  #: groups, sheets: that there are to choose from
    sheets: Sequence[str] = ()
    problems: Sequence[Problem] = ()


def preview_export(path: Path, options: ReadOptions) -> ExportPreview:
    """Read an export as `read_export` does; what is wrong with it is beside what could be read."""
    preview, table = preview_table(path, options)
    if table is None:
        return preview
    roles = find_roles(table, options, ProblemList(path))
    export, problems = None, tuple[Problem, ...]()
    try:
        export = to_export(table, options)
    except RecordingError as error:
        problems = error.problems
    role_of = {column: role for role, column in roles.column.items()}
    return replace(
        preview,
        export=export,
        roles=[role_of.get(k, "-") for k in range(len(preview.roles))],
        assumed=table.assumed if export is None else export.taken,
        groups=list(dict.fromkeys(group_labels(table, roles) or ()))[:_MAX_GROUPS],
        problems=problems,
    )


def preview_table(path: Path, options: ReadOptions) -> tuple[ExportPreview, RawTable | None]:
    """The top of any table, no column taken for anything; and the whole table.

    None in its place for a file that is no table of text, or that `problems` are about.
    """
    try:
        table = read_table(path, options)
    except RecordingError as error:
        line, rows = _lines_at_top(path, options.limits)
        sheets = _sheets(path, _recognised(path), options.limits)
        return ExportPreview(None, line=line, rows=rows, sheets=sheets, problems=error.problems), None
    if isinstance(table, InstrumentExport):
        return _of_samples(table), None
    columns = table.columns[:_MAX_COLUMNS]
    preview = ExportPreview(
        None,
        shape=table.shape,
        line=table.line[:SHOWN_ROWS].tolist(),
        rows=_cut(zip(*(cells[:SHOWN_ROWS] for cells in columns), strict=True)),
        header=[name[:_CELL_WIDTH] for name in (table.header or ())[:_MAX_COLUMNS]],
        roles=["-"] * len(columns),
        assumed=table.assumed,
        sheets=_sheets(path, instrument_formats()[table.shape], options.limits),
    )
    return preview, table


def _of_samples(export: InstrumentExport) -> ExportPreview:
    """A file of numbers without columns of text."""
    times = [] if export.time_s is None else ["time"]
    first_rows = [[f"{value:.9g}" for value in row] for row in export.values[:SHOWN_ROWS]]
    if export.time_s is not None:
        first_rows = [[f"{at_s:.9g}", *row] for at_s, row in zip(export.time_s, first_rows, strict=False)]
    return ExportPreview(
        export,
        shape=export.shape,
        line=export.line[:SHOWN_ROWS].tolist(),
        rows=first_rows,
        header=[f"{role} [{'s' if role == 'time' else 'mm'}]" for role in chain(times, export.axes)],
        assumed=export.taken,
    )


def _lines_at_top(path: Path, limits: ReadLimits) -> tuple[list[int], list[list[str]]]:
    """The first lines of a text, whatever they are; none of another file."""
    try:
        lines = decode_text(path, read_content(path), limits).lines[:SHOWN_ROWS]
    except RecordingError:
        return [], []
    return list(range(1, len(lines) + 1)), _cut([line] for line in lines)


def _recognised(path: Path) -> BinaryFormat | None:
    """The format of bytes that a file has; None for any other file."""
    try:
        return binary_format_of(path, read_content(path))
    except RecordingError:
        return None


def _sheets(path: Path, declared: InstrumentFormat | None, limits: ReadLimits) -> tuple[str, ...]:
    """Names of the sheets in a file; empty for a format without sheets."""
    if not isinstance(declared, BinaryFormat) or declared.sheet_names is None:
        return ()
    try:
        return declared.sheet_names(path, limits)
    except RecordingError:
        return ()


def _cut(rows: Iterable[Iterable[str]]) -> list[list[str]]:
    return [[cell[:_CELL_WIDTH] for cell in row] for row in rows]
