"""Routes of the page: static files, one event stream for each browser, the last hour, orders and recordings."""

from __future__ import annotations

import asyncio
import io
import json
import math
import shlex
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TextIO

import segno
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from compd.clock import Clock, MonotonicClock
from compd.errors import DaemonError
from compd.page.broadcast import Broadcast
from compd.page.browsers import ARMED_S, Browsers
from compd.page.daemon_link import DaemonLink
from compd.page.downloads import Downloads
from compd.page.guard import Token
from compd.page.history import History
from compd.page.joining.routes import JoinRoutes
from compd.page.limited_protocol import LimitedProtocol
from compd.page.logbook import Logbook
from compd.page.model_files import ModelFiles
from compd.page.orders import Orders, explained
from compd.page.recordings import Recordings
from compd.page.requests import LOOKS_ONLY, MAX_BODY_BYTES, answer, asked_by, keys_of, may_change, note_change, refused
from compd.page.workbench.routes import WorkbenchRoutes
from compd.page.workers.workers import Workers
from compd.report import AXES_CSS

# Width of the quiet zone around the code, in modules (ISO/IEC 18004).
_BORDER = 4
_SCALE = 4


def print_qr_code(text: str, out: TextIO) -> None:
    """Draw it on a terminal."""
    segno.make_qr(text).terminal(out, border=_BORDER, compact=True)


def svg_qr_code(text: str) -> bytes:
    """The code as an SVG document, dark on white on any background."""
    out = io.BytesIO()
    segno.make_qr(text).save(out, kind="svg", scale=_SCALE, border=_BORDER, light="#fff", dark="#000", title="QR code")
    return out.getvalue()


STATIC = Path(__file__).parent / "static"
# Longest burst (s): an hour at 1 kHz takes some gigabytes.
MAX_BURST_S = 3600.0
# Duration (s) of a burst by the page's button.
BURST_S = 5.0
_CANCEL_EVERY_S = 0.5


class Server:
    """The routes of one page. `request.scope["token"]` is from the guard in front of them."""

    def __init__(
        self,
        link: DaemonLink,
        recordings: Recordings,
        models: Path | None = None,
        clock: Clock | None = None,
        machine: Path | None = None,
        origin: str = "",
    ) -> None:
        """`models`: the directory whose model files are offered. `clock`: by which arming ends.

        `machine`: the daemon's configuration, by which recordings of this machine are opened. `origin`: by which
        browsers reach this server.
        """
        self._origin = origin
        self._link = link
        self._recordings = recordings
        self._models = ModelFiles(models or recordings.directory)
        self._orders = Orders(link, self._models)
        self._browsers = Browsers(clock or MonotonicClock())
        self._broadcast = Broadcast(link, self._browsers, recordings)
        self._workers = Workers()
        self._downloads = Downloads()
        self._workbench = WorkbenchRoutes(
            recordings, models, machine, STATIC / "workbench.html", self._workers, self._downloads
        )
        self._join = JoinRoutes(recordings, machine, STATIC / "join.html", self._workers)

    def app(self) -> Starlette:
        """The ASGI application."""
        routes = [
            Route("/", self._index),
            Route("/wall", self._wall),
            Route("/address.svg", self._address),
            Route("/live", self._live),
            Route("/history", self._history),
            Route("/moment", self._moment),
            Route("/traces", self._traces),
            Route("/arm", self._arm, methods=["POST"]),
            Route("/orders/{name}", self._consequence),
            Route("/orders/{name}", self._order, methods=["POST"]),
            Route("/models", self._list_models),
            Route("/recordings", self._list_recordings),
            Route("/recordings", self._record, methods=["POST"]),
            Route("/recordings/{name}", self._download),
            *self._workbench.routes(),
            *self._join.routes(),
            Route("/static/axes.css", self._axes),
            Mount("/static", StaticFiles(directory=STATIC)),
        ]
        logbook = [Middleware(Logbook)]
        return Starlette(routes=routes, lifespan=self._lifespan, middleware=logbook, max_body_size=MAX_BODY_BYTES)

    def end(self) -> None:
        """Let the browsers' streams end."""
        self._broadcast.end()

    @asynccontextmanager
    async def _lifespan(self, app: Starlette) -> AsyncIterator[None]:
        self._workers.prepare()  # so that the first who opens a recording waits for no import
        tasks = [asyncio.create_task(self._link.run()), asyncio.create_task(self._broadcast.run())]
        yield
        self._workers.end()
        await _ended(tasks)
        await self._recordings.stop()

    async def _axes(self, request: Request) -> Response:
        return FileResponse(AXES_CSS)

    async def _index(self, request: Request) -> Response:
        return FileResponse(STATIC / "index.html")

    async def _wall(self, request: Request) -> Response:
        return FileResponse(STATIC / "wall.html")

    async def _address(self, request: Request) -> Response:
        """The address of this server, without a token, as a QR code for another device."""
        if not self._origin:
            return refused("this server does not know its address", 404)
        return Response(svg_qr_code(self._origin), media_type="image/svg+xml")

    async def _live(self, request: Request) -> Response:
        token: Token = request.scope["token"]
        browser = self._browsers.connect(token, request.client.host if request.client else "")
        if (connection := LimitedProtocol.of(request.scope)) is not None:
            connection.begin_events()
        unbuffered = {"X-Accel-Buffering": "no"}  # asks a proxy to pass events on at once
        return StreamingResponse(self._broadcast.events(browser), headers=unbuffered, media_type="text/event-stream")

    async def _history(self, request: Request) -> Response:
        return Response(packed(self._broadcast.history), media_type="application/octet-stream")

    async def _moment(self, request: Request) -> Response:
        """The stored event nearest to `unix_s`."""
        event = self._broadcast.moments.nearest(_unix_s(request))
        return refused("nothing is kept yet", 404) if event is None else Response(event, media_type="application/json")

    async def _traces(self, request: Request) -> Response:
        """Values of the gauges in the minute before `unix_s`."""
        return JSONResponse(self._broadcast.traces.minute(_unix_s(request)))

    async def _arm(self, request: Request) -> Response:
        note_change(request)
        keys, token = await keys_of(request), request.scope["token"]
        id = str(keys.get("id"))
        if why_not := self._browsers.why_not(id, token):
            return refused(why_not, 403)
        if not keys.get("arm", True):
            self._browsers.disarm(id, token)
            return JSONResponse({"armed_s": 0})
        if self._browsers.arm(id, token) is None:
            return refused(LOOKS_ONLY, 403)
        return JSONResponse({"armed_s": ARMED_S})

    async def _consequence(self, request: Request) -> Response:
        name = request.path_params["name"]
        if name not in self._orders:
            return refused("there is no such order", 404)
        consequence = self._orders.consequence(name, request.query_params.get("subject", ""))
        return answer(asdict(consequence))

    async def _order(self, request: Request) -> Response:
        note_change(request)
        name, keys = request.path_params["name"], await keys_of(request)
        if name not in self._orders:
            return refused("there is no such order", 404)
        id, token = str(keys.get("id")), request.scope["token"]
        if self._browsers.armed(id, token) is None:
            return refused(self._browsers.why_not(id, token) or "this browser is not armed", 403)
        try:
            done = await self._orders.do(name, str(keys.get("subject", "")), asked_by(request.scope))
        except DaemonError as error:
            return refused(explained(error), 409, error.problems[0].value)
        return answer({"answer": done})

    async def _list_models(self, request: Request) -> Response:
        directory = self._models.directory
        return JSONResponse(
            {
                "directory": None if directory is None else str(directory),
                "models": self._models.listed(self._link.models),
            }
        )

    async def _list_recordings(self, request: Request) -> Response:
        return JSONResponse(
            {
                "directory": str(self._recordings.directory),
                "parts": self._recordings.listed(),
                "command": shlex.join(self._recordings.command("NAME", None)),
                "burst_command": shlex.join(self._recordings.command("NAME", BURST_S)),
            }
        )

    async def _record(self, request: Request) -> Response:
        keys = await keys_of(request)
        if not may_change(request):
            return refused(LOOKS_ONLY, 403)
        if keys.get("stop"):
            await self._recordings.stop()
            return JSONResponse({})
        burst_s = keys.get("burst_s")
        if burst_s is not None and not (isinstance(burst_s, int | float) and 0 < burst_s <= MAX_BURST_S):
            return refused(f"a burst lasts up to {MAX_BURST_S:g} s", 400)
        problem = await self._recordings.start(str(keys.get("name", "")), burst_s)
        return refused(problem, 409) if problem else JSONResponse({})

    async def _download(self, request: Request) -> Response:
        name = request.path_params["name"]
        pieces = self._recordings.archive(name)
        if pieces is None:
            return refused("there is no such recording", 404)
        headers = {"Content-Disposition": f'attachment; filename="{name}.zip"'}
        return self._downloads.answer(pieces, "application/zip", headers)


def _unix_s(request: Request) -> float:
    """Unix time (s) of a request. Raises HTTPException (400) for anything else."""
    try:
        unix_s = float(request.query_params.get("unix_s", ""))
    except ValueError:
        unix_s = math.nan
    if not math.isfinite(unix_s):
        raise HTTPException(400, "unix_s is the Unix time of a moment, s")
    return unix_s


async def _ended(tasks: Sequence[asyncio.Task[None]]) -> None:
    """Cancel tasks until they have ended: a cancellation is lost where a connection fails at the same moment."""
    running = set(tasks)
    while running:
        for task in running:
            task.cancel()
        _, running = await asyncio.wait(running, timeout=_CANCEL_EVERY_S)


def packed(history: History | None) -> bytes:
    """The tables of the history for a browser.

    A line of JSON: `columns`, and for each of `tables` its `name` and number of `rows`. Then, for each table, the times
    as float64 and the rows as float32, little-endian.
    """
    if history is None:
        return b'{"columns":[],"tables":[]}\n'
    tables = history.tables()
    shapes = [{"name": name, "rows": len(times)} for name, (times, _) in tables.items()]
    header = json.dumps({"columns": history.columns, "tables": shapes}).encode() + b"\n"
    numbers = (times.astype("<f8").tobytes() + rows.astype("<f4").tobytes() for times, rows in tables.values())
    return header + b"".join(numbers)
