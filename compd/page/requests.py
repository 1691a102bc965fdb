"""What requests to the page have in common: a JSON object as the body, who asks, what is logged, and the answers."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.types import Scope

from compd.text import nan_to_null

LONGEST_BODY_BYTES = 8192
LOOKS_ONLY = "this browser may look only"
LONGEST_LINE = 200
# Of a person's name in a line, so that role and address follow it.
_LONGEST_NAME = 100
# Keys of a request's scope: its JSON object, and whether it asks for a change, which is logged.
KEYS, CHANGE = "keys", "change"


async def keys_of(request: Request, longest_bytes: int = LONGEST_BODY_BYTES) -> Mapping[str, Any]:
    """The JSON object in a request's body. Raises HTTPException (400, 413) for anything else."""
    body = b""
    async for piece in request.stream():
        body += piece
        if len(body) > longest_bytes:
            raise HTTPException(413, "an order is short")
    try:
        keys = json.loads(body)
    except (ValueError, RecursionError):
        keys = None
    if not isinstance(keys, dict):
        raise HTTPException(400, "the body is one JSON object")
    request.scope[KEYS] = keys
    return keys


def note_change(request: Request) -> None:
    """Have the page's log tell who made this request, and what came of it: it asks for a change, allowed or not."""
    request.scope[CHANGE] = True


def may_change(request: Request) -> bool:
    """Whether the browser's token allows to write files; the page's log tells of the request, see `note_change`."""
    note_change(request)
    return bool(request.scope["token"].role == "operate")


def asked_by(scope: Scope) -> str:
    """For whom a request is made, in one line: "anna (operate) from 10.0.0.5"."""
    token, client = scope["token"], scope.get("client")
    return one_line(f"{token.name[:_LONGEST_NAME]} ({token.role}) from {client[0] if client else 'an unknown address'}")


def one_line(text: str) -> str:
    """The text in one line of at most LONGEST_LINE printable characters."""
    return "".join(character if character.isprintable() else "?" for character in text[:LONGEST_LINE])


def answer(data: Any) -> Response:
    """Plain data as JSON: null for what is not finite, and in ASCII, as what a person typed need not be encodable."""
    return Response(json.dumps(nan_to_null(data)), media_type="application/json")


def refused(reason: str, code: int, value: str = "") -> Response:
    """Why a request is not followed, with the status `code`."""
    response = answer({"reason": reason, "value": value})
    response.status_code = code
    return response
