"""The simulated machine's control socket: one JSON object per line on a Unix socket.

    {"class": "TRUTH"}                                the true tip, and what the machine does
    {"class": "MEASURE"}                              the tip as a laser tracker shows it, and the links' lengths
    {"class": "DRIVE", "scale_mm": [..]}              drive to these scale values at limited speed
    {"class": "FOLLOW", "commands": [[t, ..], ..]}    follow a controller's stream: time (s), scale values
    {"class": "TOUR"}                                 visit random points from now on
    {"class": "PLAN"}                                 measure the planned rows, from the first
    {"class": "TIP_FOR", "scale_mm": [..]}            the tip if the scales were there now
    {"class": "LOAD", "force_M_N": [x, y, z]}         load on the tool's tip
    {"class": "HEAT", "drives_W": [..], "ring_W": ..} heat sources from now on: all of `Heat`
    {"class": "FAULT", "line": "..", "fault": ".."}   break a line; "fault": null repairs it
    {"class": "LINES"}                                the lines, the fault of each, and those it can have

Every request gets one answer: TRUTH, MEASURED, FOLLOWS, TIP, LINES, or ERROR with code and text.
"""

from __future__ import annotations

import json
import socketserver
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from compd.errors import CompdError

MAX_REQUEST = 65536  # bytes
Answer = Mapping[str, Any]
Handler = Callable[[Mapping[str, Any]], Answer]


class _Server(socketserver.ThreadingMixIn, socketserver.UnixStreamServer):
    daemon_threads = True
    block_on_close = False
    handlers: Mapping[str, Handler]


class _Client(socketserver.StreamRequestHandler):
    server: _Server

    def handle(self) -> None:
        try:
            while line := self.rfile.readline(MAX_REQUEST):
                complete = line.endswith(b"\n")
                answer = _answer(self.server.handlers, line) if complete else _error("too_long", f"{len(line)} bytes")
                self.wfile.write(json.dumps(answer).encode() + b"\n")
                if not complete:
                    return
        except (BrokenPipeError, ConnectionResetError):
            return  # the client has closed the connection


class ControlSocket:
    """Serves `handlers`, by message class, to any number of clients, from its creation until `stop`."""

    def __init__(self, path: Path, handlers: Mapping[str, Handler]) -> None:
        path.unlink(missing_ok=True)
        self._path = path
        self._server = _Server(str(path), _Client)
        self._server.handlers = handlers
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.1,), name="control", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()
        self._path.unlink(missing_ok=True)


def _answer(handlers: Mapping[str, Handler], line: bytes) -> Answer:
    try:
        message = json.loads(line)
    except ValueError as error:
        return _error("not_json", f"not one JSON object on one line: {error}")
    if not isinstance(message, dict) or not isinstance(message.get("class"), str):
        return _error("no_class", 'needs "class", one of ' + ", ".join(handlers))
    handler = handlers.get(message["class"])
    if handler is None:
        return _error("unknown_class", f"{message['class']}: not one of " + ", ".join(handlers))
    try:
        return handler(message)
    except KeyError as error:
        return _error("missing_key", f"{message['class']} needs the key {error}")
    except (TypeError, ValueError) as error:
        return _error("wrong_value", f"{message['class']}: {error}")
    except CompdError as error:
        return _error("refused", str(error))


def _error(code: str, text: str) -> Answer:
    return {"class": "ERROR", "code": code, "text": text}
