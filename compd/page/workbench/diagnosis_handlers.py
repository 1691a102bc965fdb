"""Requests about the diagnosis of an open recording: begin, cancel, progress, page."""

from __future__ import annotations

import asyncio

from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from compd.page.requests import keys_of, refused
from compd.page.workbench.handlers import Handler
from compd.page.workbench.open_workbench import OpenWorkbench

# The page of a diagnosis is one file including its scripts and styles. Its sandbox has no cookie of this server and
# allows no request to any server.
_PAGE_POLICY = (
    "sandbox allow-scripts allow-downloads; default-src 'none'; script-src 'unsafe-inline'; "
    "style-src 'unsafe-inline'; img-src data: blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)


async def _diagnosis(request: Request, workbench: OpenWorkbench) -> Response:
    """Progress of the newest diagnosis; with its findings, unless the browser already shows them."""
    return JSONResponse(workbench.diagnosis_summary(request.query_params.get("shown", "")))


async def _diagnose(request: Request, workbench: OpenWorkbench) -> Response:
    """`cancel`: end the running one; else begin one. Allowed to everyone, since it changes nothing."""
    keys = await keys_of(request)
    if keys.get("cancel"):
        if workbench.diagnosis is not None:
            workbench.diagnosis.cancel()
    else:
        await workbench.diagnose()
    return JSONResponse(workbench.diagnosis_summary())


async def _page(request: Request, workbench: OpenWorkbench) -> Response:
    job = workbench.diagnosis
    page = b"" if job is None else await asyncio.to_thread(lambda: job.page)
    if not page:
        return refused("there is no page of a diagnosis yet", 404)
    return Response(page, media_type="text/html", headers={"Content-Security-Policy": _PAGE_POLICY})


DIAGNOSIS_HANDLERS = (
    Handler("/diagnosis", _diagnosis),
    Handler("/diagnosis", _diagnose, "POST"),
    Handler("/diagnosis/page", _page),
)
