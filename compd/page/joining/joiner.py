"""`compd join` in a worker: parsed exports, and the requests of the join wizard."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from compd.arrays import FloatArray
from compd.errors import CompdError, RecordingError
from compd.files import file_stamp
from compd.instruments import ExportPreview, InstrumentExport, ReadOptions, preview_export, track_of
from compd.joining import (
    ClockOffset,
    JoinOptions,
    JoinResult,
    RestJoin,
    agreement_curve,
    choose_by,
    match_export,
    summary_lines,
)
from compd.page.joining.choices import Choices, read_choices
from compd.page.joining.exports import Exports
from compd.page.joining.named_files import missing, named
from compd.page.recording_machine import machine_of
from compd.page.recordings import NAME
from compd.recording import read_recording, write_recording
from compd.units import UM_PER_MM


def tried(gauges: Path, export: InstrumentExport, options: JoinOptions) -> dict[str, Any]:
    """The result of `match_export` for a browser; no file is written.

    `reason` : why they cannot be put together, "" if they can. `lines` : what the command prints. `by` : what puts
    the rows together, "" if that is not clear. `time` : curve and offset. `rest` : each point with its dwell.
    """
    answer: dict[str, Any] = {"reason": "", "lines": [], "by": "", "time": None, "rest": None}
    joined: JoinResult | RestJoin | None = None
    try:
        answer["by"] = choose_by(options.by, export)
        joined = match_export(gauges, export, options)
        answer["lines"] = summary_lines(joined)
    except CompdError as error:
        answer["reason"] = str(error)
    if isinstance(joined, RestJoin):
        answer["rest"] = _rest(joined)
    elif answer["by"] == "time":
        # the picture shows best why no offset is found
        answer["time"] = _time(gauges, export, joined.offset if joined else None)
    return answer


def _time(gauges: Path, export: InstrumentExport, offset: ClockOffset | None) -> dict[str, Any] | None:
    """The agreement over all offsets; None if there is none."""
    try:
        recording, track = read_recording(gauges, needs_reference=False), track_of(export)
        if recording.motion_mm is None:
            return None
        curve = agreement_curve(recording.time_s, recording.motion_mm, track)
    except RecordingError:
        return None
    answer: dict[str, Any] = {
        "offset_s": _numbers(curve.offset_s),
        "agreement": _numbers(curve.agreement),
        "window_s": curve.window_s,
    }
    if offset is not None:
        answer["peak"] = [offset.offset_s, offset.agreement]
        answer["next_best"] = None if offset.runner_up is None else list(offset.runner_up)
    return answer


def _rest(joined: RestJoin) -> dict[str, Any]:
    return {
        "line": joined.line.tolist(),
        "dwell_number": joined.dwell_number.tolist(),
        "residual_um": _numbers(joined.residual_mm * UM_PER_MM),
        "dwells": len(joined.dwells),
    }


def _numbers(values: FloatArray) -> list[float]:
    return [float(value) for value in values]


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


class _Join(NamedTuple):
    """A browser's request with the files that it names. gauges, out : None before a choice."""

    gauges: Path | None
    export: Path
    out: Path | None
    choices: Choices

    def command(self, directory: Path) -> str:
        """The command line; words in capitals stand for missing choices."""
        chosen = (self.gauges or directory / "RECORDING.csv", self.export, self.out or directory / "NAME.csv")
        return self.choices.command(*chosen)


class Joiner:
    """Joins recordings of a directory with exports of another."""

    kept = None

    def __init__(self, recordings: Path, exports: Path, machine: Path | None, kept: None = None) -> None:
        """recordings, exports : the directories. machine : the page's configuration."""
        self._directory, self._machine = recordings, machine
        self._exports = Exports(exports)
        self._reader = ExportReader()

    def table(self, keys: Mapping[str, Any]) -> dict[str, Any]:
        """The preview of an export. keys : the choices. Raises CompdError for a missing file or an invalid choice."""
        join = self._join(keys)
        contents = table_contents(self._reader.read(join.export, join.choices.read))
        return {**contents, "command": join.command(self._directory)}

    def trial(self, keys: Mapping[str, Any]) -> dict[str, Any]:
        """See `tried`. Raises as `table`."""
        join = self._join(keys)
        gauges, export = self._whole(join)
        return tried(gauges, export, join.choices.join)

    def write(self, keys: Mapping[str, Any]) -> dict[str, Any]:
        """Write the new recording. Raises as `table`, and if the rows cannot be joined."""
        join = self._join(keys)
        gauges, export = self._whole(join)
        if join.out is None:
            raise missing("name", "the recording that is written needs a name")
        joined = match_export(gauges, export, join.choices.join)
        write_recording(join.out, joined.columns, joined.sidecar)
        return {"recording": join.out.stem, "path": str(join.out), "lines": summary_lines(joined)}

    def _join(self, keys: Mapping[str, Any]) -> _Join:
        """Raises CompdError for a missing file or an invalid choice."""
        export = self._exports.path_of(str(keys.get("export", "")))
        if export is None:
            raise missing("export", "there is no such export", "choose one, or bring one from your computer")
        gauges, plan = (named(self._directory, keys, key) for key in ("recording", "plan"))
        name = str(keys.get("name") or "")
        if name and not NAME.fullmatch(name):
            raise missing("name", "a name has letters, digits, - and _, at most 64 of them")
        needs_machine = gauges is not None and keys.get("by") in ("order", "name", "distance")
        machine = machine_of(gauges, self._machine) if needs_machine and gauges is not None else None
        out = self._directory / f"{name}.csv" if name else None
        return _Join(gauges, export, out, read_choices(keys, machine, plan))

    def _whole(self, join: _Join) -> tuple[Path, InstrumentExport]:
        """The recording and the export. Raises CompdError if one is missing or unreadable."""
        if join.gauges is None:
            raise missing("recording", "no recording of the gauges is chosen")
        preview = self._reader.read(join.export, join.choices.read)
        if preview.export is None:
            raise RecordingError(preview.problems)
        return join.gauges, preview.export
