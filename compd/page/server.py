"""The page's server: static files, one stream of events to each browser, the last hour, orders and recordings."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from compd.clock import MonotonicClock
from compd.errors import DaemonError
from compd.page.browsers import Browser, Browsers
from compd.page.daemon_link import DaemonLink
from compd.page.guard import Token
from compd.page.history import History
from compd.page.orders import Orders, explained
from compd.page.recordings import Recordings
from compd.page.scene import Scene

STATIC = Path(__file__).parent / "static"
# Live events per second, and how often the slower ones come, s.
LIVE_HZ = 10.0
STATUS_EVERY_S = 1.0
# Without news of the daemon an event comes all the same, so that its silence is seen.
_QUIET_EVENT_S = 0.5

Event = Mapping[str, Any]


class Page:
    """What all browsers share."""

    def __init__(self, link: DaemonLink, recordings: Recordings) -> None:
        self.link = link
        self.browsers = Browsers(MonotonicClock())
        self.orders = Orders(link)
        self.recordings = recordings
        self.history: History | None = None
        self._scene: Scene | None = None
        self._scene_of: Any = None

    async def keep_history(self) -> None:
        """Note what comes, until cancelled."""
        while True:
            await self._news(1 / LIVE_HZ)
            if self.link.machine is None or self.link.version is None:
                continue
            if self.history is None:
                self.history = History(self.link.version["links"])
            readings = self.link.readings
            self.history.note(time.time(), None if readings is None else readings["setpoint"], self.link.budget)

    async def _news(self, timeout_s: float) -> None:
        """Wait for news of the daemon, and at most so long."""
        try:
            async with asyncio.timeout(timeout_s), self.link.news:
                await self.link.news.wait()
        except TimeoutError:
            pass

    def live(self) -> Event:
        """The newest of everything that moves. `made`: s on a monotonic clock, by which a browser sees how late it is."""
        link = self.link
        event: dict[str, Any] = {"made": time.monotonic(), "unix_s": time.time(), "connected": link.connected, "reason": link.reason}
        if link.connected and link.readings is not None:
            event["setpoint"] = link.readings["setpoint"]
            event["values"] = self._values(link.readings)
            event["budget"] = (link.budget or {}).get("tip_um")
            event["scene"] = self._points(link.readings["setpoint"])
        return event

    def slow(self) -> Event:
        """Status, browsers and the recording that runs."""
        running = self.recordings.running
        return {
            "status": self.link.status,
            "browsers": self.browsers.summary(),
            "recording": None if running is None else {"name": running.name, "started": running.started_s},
            "last_words": self.recordings.last_words,
        }

    def _values(self, readings: Event) -> list[float | None]:
        """What each wired channel shows, in the order of MACHINE's wiring: lengths in mm since machine zero."""
        zero = readings.get("zero", {}).get("readings_mm", {})
        values: list[float | None] = []
        for column in self.link.columns:
            value = readings["readings"][column["channel"]].get("value")
            if value is not None and "sign" in column:
                at_zero = zero.get(column["channel"])
                value = None if at_zero is None else column["sign"] * (value - at_zero)
            values.append(value)
        return values

    def _points(self, setpoint: Event) -> Any:
        machine = self.link.machine
        if machine is None:
            return None
        if self._scene is None or self._scene_of is not machine:
            self._scene, self._scene_of = Scene(machine), machine
        return self._scene.points(setpoint, self.link.budget)

    async def events(self, browser: Browser) -> AsyncIterator[bytes]:
        """The events of one browser, until it goes. Each is the newest: one that is slow gets fewer."""
        slow_due_s = 0.0
        try:
            yield _event("hello", {"id": browser.id, "role": browser.role, "machine": self.link.machine})
            machine = self.link.machine
            while True:
                if self.link.machine is not machine:
                    machine = self.link.machine
                    yield _event("machine", {"machine": machine})
                yield _event("live", self.live())
                now_s = time.monotonic()
                if now_s >= slow_due_s:
                    slow_due_s = now_s + STATUS_EVERY_S
                    yield _event("slow", self.slow())
                await asyncio.sleep(1 / LIVE_HZ)
                if not self.link.connected:
                    await self._news(_QUIET_EVENT_S)
        finally:
            self.browsers.disconnect(browser)


def _event(name: str, data: Event) -> bytes:
    return f"event: {name}\ndata: {json.dumps(data, separators=(',', ':'))}\n\n".encode()


def make_app(page: Page) -> Starlette:
    """The routes. `scope["token"]` is from the guard in front of them."""

    async def index(request: Request) -> Response:
        return FileResponse(STATIC / "index.html")

    async def live(request: Request) -> Response:
        token: Token = request.scope["token"]
        address = request.client.host if request.client else ""
        browser = page.browsers.connect(token.name, address, token.role)
        return StreamingResponse(page.events(browser), media_type="text/event-stream")

    async def history(request: Request) -> Response:
        return Response(_packed(page.history), media_type="application/octet-stream")

    async def arm(request: Request) -> Response:
        keys = await request.json()
        if not keys.get("arm", True):
            page.browsers.disarm(str(keys.get("id")))
            return JSONResponse({"armed_s": 0})
        browser = page.browsers.arm(str(keys.get("id")))
        if browser is None:
            return _refused("this browser may look only, or is not connected", 403)
        return JSONResponse({"armed_s": 60})

    async def consequence(request: Request) -> Response:
        name = request.path_params["name"]
        if name not in page.orders:
            return _refused("there is no such order", 404)
        told = page.orders.consequence(name, request.query_params.get("subject", ""))
        return JSONResponse({"possible": told.possible, "text": told.text, "command": told.command})

    async def order(request: Request) -> Response:
        name, keys = request.path_params["name"], await request.json()
        if name not in page.orders:
            return _refused("there is no such order", 404)
        if page.browsers.armed(str(keys.get("id"))) is None:
            return _refused("this browser is not armed", 403)
        try:
            answer = await page.orders.do(name, str(keys.get("subject", "")))
        except DaemonError as error:
            return _refused(explained(error), 409, error.problems[0].value)
        return JSONResponse({"answer": answer})

    async def recordings(request: Request) -> Response:
        if request.method == "GET":
            return JSONResponse({"directory": str(page.recordings.directory), "parts": page.recordings.listed()})
        keys = await request.json()
        if request.scope["token"].role != "owner":
            return _refused("this browser may look only", 403)
        if keys.get("stop"):
            await page.recordings.stop()
            return JSONResponse({})
        problem = await page.recordings.start(str(keys.get("name", "")), keys.get("burst_s"))
        return _refused(problem, 409) if problem else JSONResponse({})

    async def download(request: Request) -> Response:
        name = request.path_params["name"]
        data = await asyncio.to_thread(page.recordings.archive, name)
        if data is None:
            return _refused("there is no such recording", 404)
        headers = {"Content-Disposition": f'attachment; filename="{name}.zip"'}
        return Response(data, media_type="application/zip", headers=headers)

    @asynccontextmanager
    async def lifespan(app: Starlette) -> AsyncIterator[None]:
        async with asyncio.TaskGroup() as tasks:
            running = [tasks.create_task(page.link.run()), tasks.create_task(page.keep_history())]
            yield
            for task in running:
                task.cancel()

    return Starlette(
        routes=[
            Route("/", index),
            Route("/live", live),
            Route("/history", history),
            Route("/arm", arm, methods=["POST"]),
            Route("/orders/{name}", consequence),
            Route("/orders/{name}", order, methods=["POST"]),
            Route("/recordings", recordings, methods=["GET", "POST"]),
            Route("/recordings/{name}", download),
            Mount("/static", StaticFiles(directory=STATIC)),
        ],
        lifespan=lifespan,
    )


def _refused(reason: str, code: int, value: str = "") -> JSONResponse:
    return JSONResponse({"reason": reason, "value": value}, code)


def _packed(history: History | None) -> bytes:
    """A line of JSON with the columns and the rows of each table, then float64 times and float32 rows of each."""
    if history is None:
        return b'{"columns":[],"tables":[]}\n'
    tables = history.tables()
    header = {"columns": history.columns, "tables": [{"name": n, "rows": len(t)} for n, (t, _) in tables.items()]}
    text = json.dumps(header).encode() + b"\n"
    text = text.rstrip(b"\n") + b" " * (-(len(text)) % 8) + b"\n"  # so that the numbers lie on whole words
    return text + b"".join(times.astype("<f8").tobytes() + rows.astype("<f4").tobytes() for times, rows in tables.values())
