"""The page's process: the tokens, the address, and uvicorn."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any, cast

import uvicorn

from compd.errors import DaemonError
from compd.page.connections import ConnectionLimits, Connections, raised_descriptor_limit
from compd.page.counted_log import CountedLog
from compd.page.daemon_link import DaemonLink
from compd.page.guard import Guard, Token
from compd.page.limited_protocol import ACCEPTED_AT_ONCE, MAX_HEAD_BYTES, WAITING, LimitedProtocol
from compd.page.recordings import Recordings
from compd.page.server import Server

LOOPBACK_NAMES = ("127.0.0.1", "localhost")
_HTTP_PORT = 80
# Uvicorn's own limit (s) for the next head would end before HEAD_WITHIN_S, and unknown to LimitedProtocol: a year.
NO_LIMIT_S = 365 * 86_400


def run_page(
    unix_socket: str,
    recordings: Path,
    host: str,
    port: int,
    tokens: Sequence[Token],
    started: Callable[[str], None],
    models: Path | None = None,
    behind: str | None = None,
    machine: Path | None = None,
) -> None:
    """Serve until SIGTERM or Ctrl-C.

    unix_socket : the daemon's.  recordings : directory of the recordings.
    models : directory of the model files that are offered.
    started : called with the origin, as "http://127.0.0.1:7760", once browsers can connect.
    behind : origin of a proxy with TLS in front of this server, as "https://machine.example"; only it is used then.
    machine : the daemon's configuration, by which recordings of this machine are opened.
    Raises DaemonError if the port is taken.
    """
    listener = _listener(host, port)
    port = listener.getsockname()[1]
    origins = (
        [behind] if behind else [origin(name, port) for name in (LOOPBACK_NAMES if host in LOOPBACK_NAMES else [host])]
    )
    server = Server(
        DaemonLink(unix_socket), Recordings(recordings, unix_socket), models, machine=machine, origin=origins[0]
    )
    guarded = Guard(server.app(), tokens, origins, port)
    log = CountedLog()
    config = limited_config(guarded, Connections(ConnectionLimits.for_descriptors(raised_descriptor_limit()), log))
    config.proxy_headers = behind is not None  # no proxy names the client of a request
    started(origins[0])
    _Uvicorn(config, server.end, log).run(sockets=[listener])


def limited_config(app: Guard, connections: Connections) -> uvicorn.Config:
    """Settings of a server with these connections. It logs errors only: any host can send data that is no HTTP."""
    return uvicorn.Config(
        app,
        loop="asyncio",
        http=cast("type[asyncio.Protocol]", partial(LimitedProtocol, connections)),
        ws="none",
        lifespan="on",
        log_config=None,
        log_level="error",
        access_log=False,
        backlog=ACCEPTED_AT_ONCE,
        timeout_graceful_shutdown=1,
        timeout_keep_alive=NO_LIMIT_S,
        h11_max_incomplete_event_size=MAX_HEAD_BYTES,
        server_header=False,
    )


def origin(host: str, port: int) -> str:
    """Origin as a browser writes it (RFC 6454, section 6.1): IPv6 in brackets, without the default port."""
    name = f"[{host}]" if ":" in host else host
    return f"http://{name}" + (f":{port}" if port != _HTTP_PORT else "")


class _Uvicorn(uvicorn.Server):
    """Ends the streams of events before it waits for its connections."""

    def __init__(self, config: uvicorn.Config, end: Callable[[], None], log: CountedLog) -> None:
        super().__init__(config)
        self._end = end
        self._log = log

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Begin to listen."""
        asyncio.get_running_loop().set_exception_handler(self._loop_failed)
        await super().startup(sockets)
        for listener in sockets or []:
            listener.listen(WAITING)  # asyncio has one number for waiting connections and for those accepted at once

    def _loop_failed(self, loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        """Handle an error in the event loop. asyncio tries again if no connection could be accepted."""
        if "accept" in context.get("message", "") and isinstance(context.get("exception"), OSError):
            self._log.note("not_accepted")
        else:
            loop.default_exception_handler(context)

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """Handle SIGTERM or SIGINT."""
        self._end()
        super().handle_exit(sig, frame)


def _listener(host: str, port: int) -> socket.socket:
    listener = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
    except OSError as error:
        listener.close()
        raise DaemonError.of(
            f"{host}:{port}",
            f"cannot listen: {error.strerror}",
            next_step="give another --port, or end the page that runs there",
        ) from error
    listener.listen()
    return listener
