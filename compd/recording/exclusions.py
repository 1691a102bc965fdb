"""Rows that a person leaves out of a recording, written into its sidecar; the rest of the file stays unchanged."""

from __future__ import annotations

import io
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq

from compd.data_fault import row_stretches
from compd.errors import CompdError, Problem, RecordingError
from compd.files import write_files
from compd.recording.sidecar import Sidecar, read_sidecar

_KEY = "excluded_rows"


def exclude_rows(recording: Path, rows: Collection[int], reason: str) -> None:
    """Leave rows out of a recording.

    recording : NAME.csv or NAME.parquet, with NAME.yaml beside it.
    rows : as a spreadsheet shows them; the header is row 1.
    reason : why; it must be written.

    A row that is left out already gets the new reason. Comments in the sidecar stay, and so does the order of its keys.
    Raises RecordingError if there is no reason, no row, or the sidecar cannot be used.
    """
    if not reason.strip() or not rows:
        what = "needs a reason" if rows else "needs a row"
        raise RecordingError.of("exclusion", what, allowed='rows and a reason, as in "the beam was cut"')
    document, text = _with_rows_free(recording, rows)
    entries = document.setdefault(_KEY, CommentedSeq())
    entries.append(_entry(sorted(rows), reason.strip()))
    _write(recording, document, text)


def include_rows(recording: Path, rows: Collection[int]) -> None:
    """Let rows that a person left out count again; others stay unchanged.

    Raises RecordingError if the sidecar cannot be used.
    """
    _write(recording, *_with_rows_free(recording, rows))


def rows_text(rows: Collection[int]) -> str:
    """Rows in few words: "17-20,25"."""
    return ",".join(str(first) if first == last else f"{first}-{last}" for first, last in row_stretches(rows))


def rows_of_text(text: str, where: str) -> list[int]:
    """The rows of "17-20,25", rising. Raises RecordingError for anything else."""
    rows: set[int] = set()
    try:
        for part in text.split(","):
            first, dash, last = part.partition("-")
            stretch = range(int(first), int(last if dash else first) + 1)
            if not stretch or stretch[0] < 2:
                raise ValueError
            rows.update(stretch)
    except ValueError:
        raise RecordingError.of(
            where, "names no rows", value=text, allowed="rows as a spreadsheet shows them, 2 or more, as in 17-20,25"
        ) from None
    return sorted(rows)


def _with_rows_free(recording: Path, rows: Collection[int]) -> tuple[CommentedMap, str]:
    """The sidecar's document with these rows in no exclusion, and the text as it was."""
    path = recording.with_suffix(".yaml")
    sidecar = _checked(path)
    text = path.read_text(encoding="utf-8")
    document: CommentedMap = _yaml().load(text)
    entries = document.get(_KEY) or CommentedSeq()
    kept = CommentedSeq()
    for entry in entries:
        own = _rows_of(entry)
        left = [row for row in own if row not in rows]
        if left == own:
            kept.append(entry)
        elif left:
            kept.append(_entry(left, sidecar.excluded[left[0]]))
    if kept:
        document[_KEY] = kept
    else:
        document.pop(_KEY, None)
    return document, text


def _rows_of(entry: Any) -> list[int]:
    """The rows of an entry that has been checked: 17, [17, 20] or "17-20" under `row` or `rows`."""
    rows: list[int] = []
    for value in (entry.get("row"), entry.get("rows")):
        if isinstance(value, str):
            first, _, last = value.partition("-")
            rows += range(int(first), int(last) + 1)
        elif value is not None:
            rows += value if isinstance(value, list) else [value]
    return rows


def _entry(rows: Sequence[int], reason: str) -> CommentedMap:
    stretches = row_stretches(rows)
    entry = CommentedMap()
    if len(rows) == 1:
        entry["row"] = rows[0]
    elif len(stretches) == 1:
        entry["rows"] = rows_text(rows)
    else:
        entry["rows"] = CommentedSeq(rows)
        entry["rows"].fa.set_flow_style()
    entry["reason"] = reason
    entry.fa.set_flow_style()
    return entry


def _write(recording: Path, document: CommentedMap, before: str) -> None:
    """Write the sidecar; restore it if it cannot be read afterwards."""
    path = recording.with_suffix(".yaml")
    text = io.StringIO()
    _yaml().dump(document, text)
    try:
        write_files({path: text.getvalue()})
        _checked(path)
    except (OSError, CompdError) as error:
        write_files({path: before})
        raise RecordingError.of(str(path), f"cannot be changed: {error}") from error


def _checked(path: Path) -> Sidecar:
    problems: list[Problem] = []
    sidecar = read_sidecar(path, problems)
    if problems or sidecar is None:
        raise RecordingError(problems)
    return sidecar


def _yaml() -> YAML:
    yaml = YAML()
    yaml.preserve_quotes = True
    yaml.width = 110
    return yaml
