"""Common parts of requests to the page: the JSON body, the person, the log and the answers."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.types import Scope

from compd.page.shown_texts import shown
from compd.text import nan_to_null

# Largest body of a request, but for those routes that allow more.
MAX_BODY_BYTES = 8192
LOOKS_ONLY = "this browser is read-only"
MAX_LINE = 200
# Most characters of a person's name in a log line, which leaves room for role and address.
_MAX_NAME = 100
# Keys of a request's scope: its JSON object, and whether it asks for a change, which is logged.
KEYS, CHANGE = "keys", "change"


async def keys_of(request: Request) -> Mapping[str, Any]:
    """The JSON object in a request's body. Raises HTTPException (400) for anything else."""
    try:
        keys = await request.json()
    except (ValueError, RecursionError):
        keys = None
    if not isinstance(keys, dict):
        raise HTTPException(400, "the body is one JSON object")
    request.scope[KEYS] = keys
    return keys


def note_change(request: Request) -> None:
    """Mark a request as one for a change, allowed or not: the page's log has its person and its result."""
    request.scope[CHANGE] = True


def may_change(request: Request) -> bool:
    """Whether the browser's token may write files; the request is logged, see `note_change`."""
    note_change(request)
    return bool(request.scope["token"].role == "operate")


def asked_by(scope: Scope) -> str:
    """The person behind a request in one line: "anna (operate) from 10.0.0.5"."""
    token, client = scope["token"], scope.get("client")
    return one_line(f"{token.name[:_MAX_NAME]} ({token.role}) from {client[0] if client else 'an unknown address'}")


def one_line(text: str) -> str:
    """The text in one line of at most MAX_LINE printable characters."""
    return "".join(character if character.isprintable() else "?" for character in text[:MAX_LINE])


def answer(data: Any) -> Response:
    """Plain data as ASCII JSON, since typed text may not be encodable; `shown`, with null for non-finite numbers."""
    return Response(json.dumps(nan_to_null(shown(data))), media_type="application/json")


def refused(reason: str, code: int, value: str = "") -> Response:
    """The answer to a refused request: the reason, with the status `code`."""
    response = answer({"reason": reason, "value": value})
    response.status_code = code
    return response
