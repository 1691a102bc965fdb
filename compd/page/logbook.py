"""The page's log of changes: person, request and result, one event for each request."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import structlog
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from compd.page.requests import CHANGE, KEYS, asked_by, one_line

# Keys of a request's JSON object that name its subject. The id of a connection is excluded: it is a secret.
_SUBJECT = (
    *("arm", "subject", "name", "burst_s", "stop", "kind", "effect", "recording", "export", "plan", "delete"),
    *("replace", "reason"),
)
_READS = ("GET", "HEAD")
_MAX_REASON_BYTES = 4096

_log = structlog.get_logger()


class Logbook:
    """ASGI middleware behind the guard: logs every request for a change, accepted or refused."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or scope["method"] in _READS:
            await self._app(scope, receive, send)
            return
        status, body = 0, b""

        async def send_and_note(message: Message) -> None:
            nonlocal status, body
            status = message.get("status", status)
            if not body:
                body = message.get("body", b"")[:_MAX_REASON_BYTES]
            await send(message)

        try:
            await self._app(scope, receive, send_and_note)
        finally:
            if scope.get(CHANGE):
                what = one_line(f"{scope['method']} {scope['path']}")
                outcome = "the browser has gone" if not status else "done" if status < 400 else _refusal(status, body)
                _log.info("change", by=asked_by(scope), what=what, subject=_subject(scope), outcome=outcome)


def _subject(scope: Scope) -> str:
    """The subject of the request in one line."""
    keys: Mapping[str, Any] = scope.get(KEYS, {})
    said = [f"{key} {keys[key]}" for key in _SUBJECT if keys.get(key) not in (None, "")]
    if isinstance(rows := keys.get("rows"), list):
        said.append(f"{len(rows)} rows")
    if isinstance(declaration := keys.get("declaration"), dict):
        said.append(f"effect {declaration.get('id')}")
    if query := scope["query_string"].decode("ascii", "replace"):
        said.append(query)
    return one_line(", ".join(said))


def _refusal(status: int, body: bytes) -> str:
    """Status and reason of a refused request."""
    try:
        reason = json.loads(body)["reason"]
    except (ValueError, LookupError, TypeError):
        reason = body.decode(errors="replace")
    return one_line(f"refused ({status}): {reason}")
