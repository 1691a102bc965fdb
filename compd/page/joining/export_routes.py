"""Routes for stored exports: their size against the limit, and deletion."""

from __future__ import annotations

import asyncio

from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from compd.errors import RecordingError
from compd.page.joining.exports import Exports
from compd.page.requests import LOOKS_ONLY, answer, may_change, refused


def export_routes(exports: Exports) -> list[Route]:
    """GET /join/exports; DELETE /join/exports/{name} for tokens that may change files."""

    async def usage(request: Request) -> Response:
        return answer((await asyncio.to_thread(exports.usage)).as_json())

    async def delete(request: Request) -> Response:
        if not may_change(request):
            return refused(LOOKS_ONLY, 403)
        try:
            deleted = exports.delete(request.path_params["name"])
        except RecordingError as error:
            return refused(str(error), 409)
        return answer({}) if deleted else refused("there is no such export", 404)

    return [
        Route("/join/exports", usage),
        Route("/join/exports/{name}", delete, methods=["DELETE"]),
    ]
