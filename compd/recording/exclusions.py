"""Rows that a person leaves out of a recording, written into its sidecar; the rest of the file stays unchanged."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

from compd.data_fault import row_stretches
from compd.documents import parse_yaml, read_text, with_entries
from compd.errors import CompdError, Problem, RecordingError
from compd.files import write_files
from compd.recording.sidecar import read_sidecar

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
    _write(recording, rows, [_entry(sorted(rows), reason.strip())])


def include_rows(recording: Path, rows: Collection[int]) -> None:
    """Let rows that a person left out count again; others stay unchanged.

    Raises RecordingError if the sidecar cannot be used.
    """
    _write(recording, rows)


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


def _write(recording: Path, rows: Collection[int], added: Sequence[Mapping[str, Any]] = ()) -> None:
    """Write the sidecar with these rows in no exclusion but those that are added.

    It is restored if it cannot be read afterwards.
    """
    path = recording.with_suffix(".yaml")
    _check(path)
    before = read_text(path, "a sidecar")
    entries: list[Any] = []
    for entry in parse_yaml(before, path)[0].get(_KEY) or ():
        own = _rows_of(entry)
        left = [row for row in own if row not in rows]
        if left:
            entries.append(entry if left == own else _entry(left, entry["reason"]))
    try:
        write_files({path: with_entries(before, path, _KEY, [*entries, *added])})
        _check(path)
    except (OSError, CompdError) as error:
        write_files({path: before})
        raise RecordingError.of(str(path), f"cannot be changed: {error}") from error


def _rows_of(entry: Mapping[str, Any]) -> list[int]:
    """The rows of an entry that has been checked: 17, [17, 20] or "17-20" under `row` or `rows`."""
    rows: list[int] = []
    for value in (entry.get("row"), entry.get("rows")):
        if isinstance(value, str):
            first, _, last = value.partition("-")
            rows += range(int(first), int(last) + 1)
        elif value is not None:
            rows += value if isinstance(value, list) else [value]
    return rows


def _entry(rows: Sequence[int], reason: str) -> dict[str, Any]:
    if len(rows) == 1:
        return {"row": rows[0], "reason": reason}
    return {"rows": rows_text(rows) if len(row_stretches(rows)) == 1 else list(rows), "reason": reason}


def _check(path: Path) -> None:
    problems: list[Problem] = []
    if read_sidecar(path, problems) is None or problems:
        raise RecordingError(problems)
