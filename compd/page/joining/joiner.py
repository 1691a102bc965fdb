"""`compd join` in a worker: parsed exports, and the requests of the join wizard."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from compd.errors import RecordingError
from compd.instruments import InstrumentExport
from compd.joining import match_export, summary_lines
from compd.page.joining.choices import Choices, read_choices
from compd.page.joining.export_table import ExportReader, table_contents
from compd.page.joining.exports import Exports
from compd.page.joining.named_files import missing, named
from compd.page.joining.trial import tried
from compd.page.recording_machine import machine_of
from compd.page.recordings import NAME
from compd.recording import write_recording


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
