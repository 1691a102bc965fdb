"""The routes of the join wizard: what there is to join, how an export is read, a join that is tried, and written."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from starlette.requests import ClientDisconnect, Request
from starlette.responses import FileResponse, Response
from starlette.routing import Route

from compd.errors import CompdError, Problem, RecordingError
from compd.instruments.export import InstrumentExport
from compd.joining.join import match_export
from compd.joining.summary import summary_lines
from compd.page.joining.choices import Choices, read_choices
from compd.page.joining.export_routes import export_routes
from compd.page.joining.export_table import ExportReader, table_contents
from compd.page.joining.exports import MOST_BYTES, Exports
from compd.page.joining.trial import tried
from compd.page.recording_machine import machine_of
from compd.page.recordings import NAME, Recordings, recording_tables
from compd.page.requests import LOOKS_ONLY, answer, keys_of, may_change, refused
from compd.recording.sidecar import read_sidecar
from compd.recording.table_file import CSV
from compd.recording.writer import write_recording

Result = TypeVar("Result")

EXPORTS = "exports"


class _Join(NamedTuple):
    """What a browser asks for, with the files that it names. gauges, out : None where none is chosen yet."""

    gauges: Path | None
    export: Path
    out: Path | None
    choices: Choices

    def command(self, directory: Path) -> str:
        """The command line; words in capitals stand for what is not chosen yet."""
        named = (self.gauges or directory / "RECORDING.csv", self.export, self.out or directory / "NAME.csv")
        return self.choices.command(*named)


class JoinRoutes:
    """Joins the recordings of a directory with the exports in `exports/` below it."""

    def __init__(self, recordings: Recordings, machine: Path | None, page: Path) -> None:
        """machine : the page's configuration. page : the HTML file."""
        self._directory = recordings.directory
        self._exports = Exports(recordings.directory / EXPORTS)
        self._machine = machine
        self._page = page
        self._reader = ExportReader()
        self._lock = threading.Lock()  # numpy works in threads of its own; and a name is given once

    def routes(self) -> list[Route]:
        """All of them; /join is the page itself."""
        return [
            Route("/join", self._index),
            Route("/join/sources", self._sources),
            Route("/join/exports", self._bring, methods=["POST"]),
            *export_routes(self._exports),
            Route("/join/table", self._table, methods=["POST"]),
            Route("/join/trial", self._try, methods=["POST"]),
            Route("/join/recording", self._write, methods=["POST"]),
        ]

    async def _index(self, request: Request) -> Response:
        return FileResponse(self._page)

    async def _sources(self, request: Request) -> Response:
        """Recordings of gauges alone, plans, exports, and whether this browser may write."""
        gauges, plans = await asyncio.to_thread(_gauges_and_plans, self._directory)
        return answer(
            {
                "directory": str(self._directory),
                "gauges": gauges,
                "plans": plans,
                "exports": self._exports.listed(),
                "may_write": may_change(request),
                "most_bytes": MOST_BYTES,
            }
        )

    async def _bring(self, request: Request) -> Response:
        """The body is the file; the query names it."""
        if not may_change(request):
            return refused(LOOKS_ONLY, 403)
        try:
            return answer(await self._exports.keep(request.query_params.get("name", ""), request.stream()))
        except CompdError as error:
            return refused(str(error), 409)
        except ClientDisconnect:
            return refused("the browser has gone before the file was whole", 400)

    async def _table(self, request: Request) -> Response:
        keys = await keys_of(request)

        def answered() -> dict[str, Any]:
            join = self._join(keys)
            return {
                **table_contents(self._reader.read(join.export, join.choices.read)),
                "command": join.command(self._directory),
            }

        return await _answered(answered)

    async def _try(self, request: Request) -> Response:
        keys = await keys_of(request)

        def answered() -> dict[str, Any]:
            join = self._join(keys)
            gauges, export = self._whole(join)
            with self._lock:
                return tried(gauges, export, join.choices.join)

        return await _answered(answered)

    async def _write(self, request: Request) -> Response:
        if not may_change(request):
            return refused(LOOKS_ONLY, 403)
        keys = await keys_of(request)

        def answered() -> dict[str, Any]:
            join = self._join(keys)
            gauges, export = self._whole(join)
            if join.out is None:
                raise _missing("name", "the recording that is written needs a name")
            with self._lock:
                joined = match_export(gauges, export, join.choices.join)
                write_recording(join.out, joined.columns, joined.sidecar)
            return {"recording": join.out.stem, "path": str(join.out), "lines": summary_lines(joined)}

        return await _answered(answered)

    def _join(self, keys: Mapping[str, Any]) -> _Join:
        """Raises CompdError for what is not there, or no choice."""
        export = self._exports.path_of(str(keys.get("export", "")))
        if export is None:
            raise _missing("export", "there is no such export", "choose one, or bring one from your computer")
        gauges, plan = (_named(self._directory, keys, key) for key in ("recording", "plan"))
        name = str(keys.get("name") or "")
        if name and not NAME.fullmatch(name):
            raise _missing("name", "a name has letters, digits, - and _, at most 64 of them")
        needs_machine = gauges is not None and keys.get("by") in ("order", "name", "distance")
        machine = machine_of(gauges, self._machine) if needs_machine and gauges is not None else None
        out = self._directory / f"{name}.csv" if name else None
        return _Join(gauges, export, out, read_choices(keys, machine, plan))

    def _whole(self, join: _Join) -> tuple[Path, InstrumentExport]:
        """The recording and the export. Raises CompdError where one is missing, or cannot be read."""
        if join.gauges is None:
            raise _missing("recording", "no recording of the gauges is chosen")
        preview = self._reader.read(join.export, join.choices.read)
        if preview.export is None:
            raise RecordingError(preview.problems)
        return join.gauges, preview.export


def _gauges_and_plans(directory: Path) -> tuple[list[str], list[str]]:
    """Names of the recordings without a reference, and of the CSV files without a sidecar, the newest first."""
    own = [path for name, path in recording_tables(directory).items() if NAME.fullmatch(name)]
    gauges, plans = [], []
    for path in sorted(own, key=lambda path: path.stat().st_mtime, reverse=True):
        sidecar = path.with_suffix(".yaml")
        if not sidecar.is_file():
            plans += [path.stem] * (path.suffix == CSV)
        elif (read := read_sidecar(sidecar, [])) is not None and read.reference is None:
            gauges.append(path.stem)
    return gauges, plans


def _named(directory: Path, keys: Mapping[str, Any], key: str) -> Path | None:
    """The file that a key names; None without a name. Raises RecordingError where it is not there."""
    name = str(keys.get(key) or "")
    path = recording_tables(directory).get(name)
    if name and not (NAME.fullmatch(name) and path):
        raise _missing(key, f"there is no such {key}")
    return path


def _missing(where: str, what: str, next_step: str = "") -> RecordingError:
    return RecordingError(Problem(where=where, what=what, next_step=next_step))


async def _answered(question: Callable[[], dict[str, Any]]) -> Response:
    """The answer to a question that takes long, while the server goes on; 409 with the reason where there is none."""
    try:
        return answer(await asyncio.to_thread(question))
    except CompdError as error:
        return refused(str(error), 409)
    except FileNotFoundError:
        return refused("a file has gone meanwhile: load the page again", 409)
