"""Requests about an open recording: numbers, rows to draw, effects, trials, steps."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any, NamedTuple

from starlette.requests import Request
from starlette.responses import Response

from compd.page.requests import LOOKS_ONLY, keys_of, may_change, refused
from compd.page.workbench.open_workbench import OpenWorkbench
from compd.page.workers.answering import while_asked

# Largest body (bytes): the numbers of some 100,000 rows.
MAX_ROWS_BYTES = 1_000_000


class Handler(NamedTuple):
    """A handler at an address below that of an open recording."""

    path: str
    answer: Callable[[Request, OpenWorkbench], Awaitable[Response]]
    method: str = "GET"
    max_body_size: int | None = None


async def _summary(request: Request, workbench: OpenWorkbench) -> Response:
    return plain(await workbench.ask("summary"))


async def _rows(request: Request, workbench: OpenWorkbench) -> Response:
    """Rows shown in pictures; `all`: every row, for selection."""
    return _numbers(await workbench.ask("rows", "all" in request.query_params))


async def _effects(request: Request, workbench: OpenWorkbench) -> Response:
    return plain(await workbench.ask("effects"))


async def _card(request: Request, workbench: OpenWorkbench) -> Response:
    return plain(await workbench.ask("card", request.path_params["effect"]))


async def _trial(request: Request, workbench: OpenWorkbench) -> Response:
    return _numbers(await workbench.ask("tried", request.path_params["effect"], request.path_params["variant"]))


async def _doubt(request: Request, workbench: OpenWorkbench) -> Response:
    """Whether the rows support an effect. The first request of a state takes a diagnosis, the others none."""
    return plain(await while_asked(request, workbench.doubt_of(request.path_params["effect"])))


async def _step(request: Request, workbench: OpenWorkbench) -> Response:
    """`dry_run`: preview the step. Else make it; the answer is the summary."""
    keys: Any = await keys_of(request)
    kind, effect, revision = str(keys.get("kind")), str(keys.get("effect", "")), keys.get("revision")
    if keys.get("dry_run"):
        return plain(await workbench.ask("propose", kind, effect))
    if not may_change(request):
        return refused(LOOKS_ONLY, 403)
    if kind == "undo":
        return plain(await workbench.ask("undo", revision))
    return plain(await workbench.ask("make", kind, effect, revision))


async def _exclude(request: Request, workbench: OpenWorkbench) -> Response:
    """`rows` with a `reason` are left out; without one they count again."""
    keys: Any = await keys_of(request)
    rows, reason, revision = keys.get("rows"), keys.get("reason"), keys.get("revision")
    if not may_change(request):
        return refused(LOOKS_ONLY, 403)
    if not isinstance(rows, list) or not rows or not all(type(row) is int for row in rows):
        return refused("rows is a list of numbers of rows", 400)
    if reason is None:
        return plain(await workbench.ask("include", rows, revision))
    return plain(await workbench.ask("exclude", rows, str(reason), revision))


def plain(json_text: bytes) -> Response:
    """JSON as a worker made it."""
    return Response(json_text, media_type="application/json")


def _numbers(data: bytes) -> Response:
    return Response(data, media_type="application/octet-stream")


HANDLERS = (
    Handler("/summary", _summary),
    Handler("/rows", _rows),
    Handler("/effects", _effects),
    Handler("/effects/{effect}", _card),
    Handler("/effects/{effect}/{variant:int}", _trial),
    Handler("/effects/{effect}/doubt", _doubt),
    Handler("/step", _step, "POST"),
    Handler("/exclusions", _exclude, "POST", MAX_ROWS_BYTES),
)
