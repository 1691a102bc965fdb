"""What every order to the page has: a JSON object as its body, and a refusal in words."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response

LONGEST_BODY_BYTES = 8192


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
    return keys


def refused(reason: str, code: int, value: str = "") -> Response:
    """Why a request is not followed, with the status `code`."""
    # in ASCII: what a client named need not be text that can be encoded
    return Response(json.dumps({"reason": reason, "value": value}), code, media_type="application/json")
