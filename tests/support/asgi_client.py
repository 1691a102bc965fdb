"""A client of an ASGI application without a server: requests whose answers may be endless."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Mapping
from typing import Any

from starlette.types import ASGIApp, Message


class AsgiClient:
    """Sends requests with these headers."""

    def __init__(self, app: ASGIApp, headers: Mapping[str, str]) -> None:
        self._app = app
        self._headers = [(name.lower().encode(), value.encode()) for name, value in headers.items()]

    async def post(self, path: str, keys: Mapping[str, Any]) -> tuple[int, dict[str, Any]]:
        """Status and JSON of the answer."""
        sent: list[Message] = []

        async def receive() -> Message:
            return {"type": "http.request", "body": json.dumps(keys).encode()}

        async def send(message: Message) -> None:
            sent.append(message)

        await self._app(self._scope("POST", path), receive, send)
        return sent[0]["status"], json.loads(b"".join(message.get("body", b"") for message in sent))

    def stream(self, path: str) -> Stream:
        """Of events; it begins when the block is entered."""
        return Stream(self._app, self._scope("GET", path))

    def _scope(self, method: str, path: str) -> Message:
        known = {"type": "http", "method": method, "path": path, "raw_path": path.encode(), "query_string": b""}
        address = {"client": ("127.0.0.1", 1), "server": ("127.0.0.1", 7760), "scheme": "http", "root_path": ""}
        return {**known, **address, "headers": self._headers, "asgi": {"version": "3.0", "spec_version": "2.3"}}


class Stream:
    """The events of one connection, until the block ends or `hang_up`."""

    def __init__(self, app: ASGIApp, scope: Message) -> None:
        self._app, self._scope = app, scope
        self._pieces: asyncio.Queue[bytes] = asyncio.Queue()
        self._gone = asyncio.Event()

    def hang_up(self) -> None:
        """As a browser that is closed."""
        self._gone.set()

    async def event(self) -> tuple[str, dict[str, Any]]:
        """Name and data of the next one."""
        lines = (await self._pieces.get()).decode().splitlines()
        return lines[0].removeprefix("event: "), json.loads(lines[1].removeprefix("data: "))

    async def __aenter__(self) -> Stream:
        async def receive() -> Message:
            await self._gone.wait()
            return {"type": "http.disconnect"}

        async def send(message: Message) -> None:
            if message.get("body"):
                self._pieces.put_nowait(message["body"])

        self._running = asyncio.ensure_future(self._app(self._scope, receive, send))
        return self

    async def __aexit__(self, *_: object) -> None:
        self.hang_up()
        await self._running
