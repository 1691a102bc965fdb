"""Routes of the join wizard: available files, preview of an export, trial of a join, and the join itself."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Mapping
from pathlib import Path
from typing import Any

from starlette.requests import ClientDisconnect, Request
from starlette.responses import FileResponse, Response
from starlette.routing import Route

from compd.errors import CompdError, RecordingError
from compd.instruments import ANGLE_ORDERS, instrument_formats
from compd.page.joining.exports import MAX_BYTES, Exports
from compd.page.joining.named_files import gauges_and_plans
from compd.page.recordings import Recordings
from compd.page.requests import LOOKS_ONLY, answer, keys_of, may_change, refused
from compd.page.shares import ASKER, looks_only
from compd.page.workers.answering import CLIENT_GONE, BrowserGone, while_asked
from compd.page.workers.limits import WorkerLimits
from compd.page.workers.worker import Worker
from compd.page.workers.worker_group import WorkerGroup
from compd.page.workers.workers import Workers


def export_routes(exports: Exports) -> list[Route]:
    """GET /join/exports; DELETE /join/exports/{name} for tokens that may change files."""

    async def usage(request: Request) -> Response:
        return answer((await asyncio.to_thread(exports.usage)).as_json())

    async def delete(request: Request) -> Response:
        if not may_change(request):
            return refused(LOOKS_ONLY, 403)
        try:
            deleted = exports.delete(request.path_params["name"])
        except RecordingError as error:
            return refused(str(error), 409)
        return answer({}) if deleted else refused("there is no such export", 404)

    return [
        Route("/join/exports", usage),
        Route("/join/exports/{name}", delete, methods=["DELETE"]),
    ]


EXPORTS = "exports"
_JOINER = "compd.page.joining.joiner:Joiner"
# Limits of each worker; two workers, so that one large file does not block other persons.
LIMITS = WorkerLimits(memory_mb=1500, opening_s=30.0, idle_s=60.0)
WORKERS = 2
# Limits for reading an export, and for trying or writing a join.
ANSWER_S = 120.0


class JoinRoutes:
    """Joins recordings of a directory with the exports in its subdirectory `exports/`."""

    def __init__(
        self, recordings: Recordings, machine: Path | None, page: Path, workers: Workers | None = None
    ) -> None:
        """machine : the page's configuration. page : the HTML file. workers : of the page's server."""
        self._directory = recordings.directory
        self._exports = Exports(recordings.directory / EXPORTS)
        self._page = page
        arguments = (self._directory, self._exports.directory, machine)
        self._workers = workers or Workers()
        # by whether their browsers only look: whoever writes does not wait for those
        self._joiners = {
            looks: WorkerGroup(self._workers, WORKERS, "join", _JOINER, arguments, LIMITS) for looks in (False, True)
        }
        self._writing = asyncio.Lock()  # each name is used once

    def routes(self) -> list[Route]:
        """All of them; /join is the page itself."""
        return [
            Route("/join", self._index),
            Route("/join/sources", self._sources),
            Route("/join/exports", self._bring, methods=["POST"], max_body_size=MAX_BYTES),
            *export_routes(self._exports),
            Route("/join/table", self._table, methods=["POST"]),
            Route("/join/log", self._log, methods=["POST"]),
            Route("/join/trial", self._try, methods=["POST"]),
            Route("/join/recording", self._write, methods=["POST"]),
        ]

    async def _index(self, request: Request) -> Response:
        self._workers.prepare()
        return FileResponse(self._page)

    async def _sources(self, request: Request) -> Response:
        """Recordings of gauges alone, plans, exports, the formats that are read, and whether this browser may write."""
        gauges, plans = await asyncio.to_thread(gauges_and_plans, self._directory)
        return answer(
            {
                "directory": str(self._directory),
                "gauges": gauges,
                "plans": plans,
                "exports": self._exports.listed(),
                "angles": [[order, words] for order, words in ANGLE_ORDERS.items()],
                "formats": [[declared.name, declared.title] for declared in instrument_formats().values()],
                "may_write": may_change(request),
                "most_bytes": MAX_BYTES,
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

    def _free(self, keys: Mapping[str, Any]) -> Worker:
        return self._joiners[looks_only(ASKER.get())].free(str(keys.get("export")))

    async def _table(self, request: Request) -> Response:
        keys = await keys_of(request)
        asked = self._free(keys).ask(f"{_JOINER}.table", keys, seconds=ANSWER_S)
        return await _answered(while_asked(request, asked))

    async def _log(self, request: Request) -> Response:
        keys = await keys_of(request)
        asked = self._free(keys).ask(f"{_JOINER}.log", keys, seconds=ANSWER_S)
        return await _answered(while_asked(request, asked))

    async def _try(self, request: Request) -> Response:
        keys = await keys_of(request)
        asked = self._free(keys).ask(f"{_JOINER}.trial", keys, seconds=ANSWER_S)
        return await _answered(while_asked(request, asked))

    async def _write(self, request: Request) -> Response:
        """Write the join, even if the browser disconnects, so that it is complete."""
        if not may_change(request):
            return refused(LOOKS_ONLY, 403)
        keys = await keys_of(request)
        async with self._writing:
            joiner = self._free(keys)
            return await _answered(joiner.ask(f"{_JOINER}.write", keys, seconds=ANSWER_S))


async def _answered(asked: Awaitable[bytes]) -> Response:
    """The answer of a worker; 409 with the reason if it fails."""
    try:
        return Response(await asked, media_type="application/json")
    except BrowserGone:
        return refused("the browser has gone", CLIENT_GONE)
    except CompdError as error:
        return refused(str(error), 409)
    except FileNotFoundError:
        return refused("a file has gone meanwhile: load the page again", 409)
