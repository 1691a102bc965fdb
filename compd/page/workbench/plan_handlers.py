"""Requests for planning the next measurement: the choices, the plan, and its files."""

from __future__ import annotations

import math

from starlette.requests import Request
from starlette.responses import Response

from compd.errors import CompdError
from compd.page.requests import keys_of, refused
from compd.page.workbench.handlers import Handler, plain
from compd.page.workbench.open_workbench import PLAN_S, OpenWorkbench
from compd.page.workbench.plan_endings import ENDINGS
from compd.page.workers.answering import while_asked

_QUESTIONS = "compd.page.workbench.plan_questions:"


async def _form(request: Request, workbench: OpenWorkbench) -> Response:
    """`rivals`: ids with commas; the limits of a machine with an external model depend on them."""
    names = [name for name in request.query_params.get("rivals", "").split(",") if name]
    return plain(await workbench.ask(f"{_QUESTIONS}form", names))


async def _plan(request: Request, workbench: OpenWorkbench) -> Response:
    """Allowed to everyone, since it changes nothing. Closing the connection cancels it."""
    keys = await keys_of(request)
    planned = workbench.ask_planner(f"{_QUESTIONS}planned", workbench.libraries, keys, seconds=PLAN_S)
    return plain(await while_asked(request, planned))


async def _file(request: Request, workbench: OpenWorkbench) -> Response:
    """A plan as a file; `feed` (mm/min) and `dwell` (s) for G-code."""
    key, shape = request.path_params["key"], request.path_params["format"]
    feed, dwell_s = _query_number(request, "feed", 0.1), _query_number(request, "dwell", 0.0)
    try:
        if shape not in ENDINGS:
            raise KeyError(shape)
        text = await workbench.ask_planner(f"{_QUESTIONS}file", key, shape, feed, dwell_s)
    except KeyError:
        return refused("this plan is not kept any more: plan again", 404)
    name = f"{request.path_params['recording']}-{ENDINGS[shape]}"
    return Response(text, media_type="text/plain", headers={"Content-Disposition": f'attachment; filename="{name}"'})


def _query_number(request: Request, name: str, least: float) -> float | None:
    """A number in the address; None if absent. Raises CompdError for anything else."""
    text = request.query_params.get(name, "")
    if not text:
        return None
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not least <= value < math.inf:
        raise CompdError.of(name, "is not understood", value=text[:80], allowed=f"{least:g} or more")
    return value


PLAN_HANDLERS = (
    Handler("/plan", _form),
    Handler("/plan", _plan, "POST"),
    Handler("/plan/{key}/{format}", _file),
)
