"""An export as shown in the page: the first rows as a table, the role of each column, the open questions."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

from compd.errors import RecordingError
from compd.files import file_stamp
from compd.instruments import ExportPreview, ReadOptions, preview_export
from compd.joining import choose_by

# Parsed files in memory: two persons may look at two, and change the roles of their columns.
_KEPT = 4


class _Read(NamedTuple):
    """A file at a time of change, with reading options."""

    path: Path
    stamp: tuple[int, int] | None
    options: ReadOptions
    preview: ExportPreview


class ExportReader:
    """Reads exports; caches those requested last."""

    def __init__(self) -> None:
        self._kept: list[_Read] = []

    def read(self, path: Path, options: ReadOptions) -> ExportPreview:
        """See `preview_export`."""
        stamp = file_stamp(path)
        for known in self._kept:
            if (known.path, known.stamp, known.options) == (path, stamp, options):
                return known.preview
        preview = preview_export(path, options)
        self._kept = [_Read(path, stamp, options, preview), *self._kept][:_KEPT]
        return preview


def table_contents(preview: ExportPreview) -> dict[str, Any]:
    """The preview of an export. `by`: the default way of matching rows; "" if it is ambiguous."""
    export = preview.export
    by, not_clear = "", ""
    try:
        by = "" if export is None else choose_by(None, export)
    except RecordingError as error:
        not_clear = str(error)
    return {
        "shape": preview.shape,
        "line": list(preview.line),
        "rows": [list(row) for row in preview.rows],
        "header": list(preview.header),
        "roles": list(preview.roles),
        "assumed": dict(preview.assumed),
        "groups": list(preview.groups),
        "sheets": list(preview.sheets),
        "problems": [str(problem) for problem in preview.problems],
        "points": 0 if export is None else len(export.line),
        "left_out": {} if export is None else dict(export.left_out),
        "axes": [] if export is None else list(export.axes),
        "timed": export is not None and export.time_s is not None,
        "named": export is not None and export.name is not None,
        "by": by,
        "by_not_clear": not_clear,
    }
