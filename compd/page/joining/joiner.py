"""`compd recording join` in a worker: parsed exports, and the requests of the join wizard."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Generic, NamedTuple, TypeVar

from compd.arrays import FloatArray
from compd.configuration import load_machine
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
    log_as_recording,
    machine_recording,
    match_export,
    summary_lines,
)
from compd.page.joining.choices import Choices, read_choices
from compd.page.joining.exports import Exports
from compd.page.joining.log_table import LogPreview, log_contents, preview_log, with_named_columns, without_machine
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
Preview = TypeVar("Preview")


class FileReader(Generic[Preview]):
    """Reads files by `read`; caches those requested last, each at its time of change, with its reading options."""

    def __init__(self, read: Callable[[Path, ReadOptions], Preview]) -> None:
        self._read = read
        self._kept: list[tuple[Path, tuple[int, int] | None, ReadOptions, Preview]] = []

    def read(self, path: Path, options: ReadOptions) -> Preview:
        """What `read` gives of the file."""
        stamp = file_stamp(path)
        for *known, preview in self._kept:
            if known == [path, stamp, options]:
                return preview
        preview = self._read(path, options)
        self._kept = [(path, stamp, options, preview), *self._kept][:_KEPT]
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
    """A browser's request with the files that it names. gauges, out : None before a choice. log : table of the
    machine's own log, where that is chosen in place of a recording; None where it is no table.
    """

    gauges: Path | None
    log: LogPreview | None
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
        self._reader = FileReader(preview_export)
        self._logs = FileReader(preview_log)

    def log(self, keys: Mapping[str, Any]) -> dict[str, Any]:
        """The preview of the machine's own log. Raises as `table`."""
        path = self._brought(keys, "log")
        choices = read_choices(keys, self._machine, None)
        assert choices.log is not None
        return log_contents(self._logs.read(path, choices.log.read), choices, self._machine)

    def table(self, keys: Mapping[str, Any]) -> dict[str, Any]:
        """The preview of an export. keys : the choices. Raises CompdError for a missing file or an invalid choice."""
        join = self._join(keys)
        contents = table_contents(self._reader.read(join.export, join.choices.read))
        return {**contents, "command": join.command(self._directory)}

    def trial(self, keys: Mapping[str, Any]) -> dict[str, Any]:
        """See `tried`. Raises as `table`."""
        join = self._join(keys)
        with TemporaryDirectory() as directory:
            written = join._replace(out=Path(directory) / (join.out or Path("NAME.csv")).name)
            with self._gauges(written) as gauges:
                return tried(gauges, self._export(join), join.choices.join)

    def write(self, keys: Mapping[str, Any]) -> dict[str, Any]:
        """Write the new recording. Raises as `table`, and if the rows cannot be joined."""
        join = self._join(keys)
        export = self._export(join)
        if join.out is None:
            raise missing("name", "the recording that is written needs a name")
        with self._gauges(join) as gauges:
            joined = match_export(gauges, export, join.choices.join)
            write_recording(join.out, joined.columns, joined.sidecar)
        return {"recording": join.out.stem, "path": str(join.out), "lines": summary_lines(joined)}

    def _join(self, keys: Mapping[str, Any]) -> _Join:
        """Raises CompdError for a missing file or an invalid choice."""
        export = self._brought(keys, "export")
        gauges, plan = (named(self._directory, keys, key) for key in ("recording", "plan"))
        name = str(keys.get("name") or "")
        if name and not NAME.fullmatch(name):
            raise missing("name", "a name has letters, digits, - and _, at most 64 of them")
        out = self._directory / f"{name}.csv" if name else None
        if not keys.get("log"):
            machine = None if gauges is None else machine_of(gauges, self._machine)
            return _Join(gauges, None, export, out, read_choices(keys, machine, plan))
        path, choices = self._brought(keys, "log"), read_choices(keys, self._machine, plan)
        assert choices.log is not None
        log = self._logs.read(path, choices.log.read)
        return _Join(path, log, export, out, with_named_columns(choices, log))

    def _brought(self, keys: Mapping[str, Any], key: str) -> Path:
        path = self._exports.path_of(str(keys.get(key, "")))
        if path is None:
            raise missing(key, f"there is no such {key}", "choose one, or bring one from your computer")
        return path

    def _export(self, join: _Join) -> InstrumentExport:
        """The whole export. Raises RecordingError if it is unreadable."""
        preview = self._reader.read(join.export, join.choices.read)
        if preview.export is None:
            raise RecordingError(preview.problems)
        return preview.export

    @contextmanager
    def _gauges(self, join: _Join) -> Iterator[Path]:
        """The recording of the gauges; of the machine's own log the one written beside `out`. Raises CompdError if
        one is missing or unreadable."""
        if join.gauges is None:
            raise missing("recording", "no recording of the gauges is chosen")
        if join.log is None:
            yield join.gauges
            return
        if join.log.table is None:
            raise RecordingError(join.log.preview.problems)
        if self._machine is None:
            raise without_machine()
        assert join.out is not None
        assert join.choices.log is not None
        recorded = machine_recording(join.out)
        with log_as_recording(join.log.table, recorded, load_machine(self._machine), join.choices.log):
            yield recorded
