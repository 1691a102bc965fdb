"""A request that waits for a worker; it ends when its browser disconnects."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable

from starlette.requests import Request
from starlette.types import Receive

# nginx's status for a client that closed the connection; it reaches no reader.
CLIENT_GONE = 499


class BrowserGone(Exception):
    """The client has left before the answer."""


async def while_asked(request: Request, answer: Awaitable[bytes]) -> bytes:
    """The answer; the request's body must have been read. Raises BrowserGone if the browser leaves before."""
    answering = asyncio.ensure_future(answer)
    going = asyncio.ensure_future(gone(request.receive))
    try:
        await asyncio.wait({answering, going}, return_when=asyncio.FIRST_COMPLETED)
        if not answering.done():
            raise BrowserGone
        return answering.result()
    finally:
        for task in (answering, going):
            task.cancel()


async def gone(receive: Receive) -> None:
    """Wait until the client has left; the request's body must have been read."""
    while (await receive())["type"] != "http.disconnect":
        pass
