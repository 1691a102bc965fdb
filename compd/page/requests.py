"""What every request to the page has in common: a JSON object as its body, who may change files, and the answers."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response

from compd.text.json_text import nan_to_null

LONGEST_BODY_BYTES = 8192
LOOKS_ONLY = "this browser may look only"


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


def may_change(request: Request) -> bool:
    """Whether the browser's token allows to write files."""
    return bool(request.scope["token"].role == "operate")


def answer(data: Any) -> Response:
    """Plain data as JSON: null for what is not finite, and in ASCII, as what a person typed need not be encodable."""
    return Response(json.dumps(nan_to_null(data)), media_type="application/json")


def refused(reason: str, code: int, value: str = "") -> Response:
    """Why a request is not followed, with the status `code`."""
    response = answer({"reason": reason, "value": value})
    response.status_code = code
    return response
