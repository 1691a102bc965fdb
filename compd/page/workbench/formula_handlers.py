"""Requests while a person writes an effect: names for formulas, check, saving."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response

from compd.errors import Problem, StateError
from compd.page.requests import LOOKS_ONLY, keys_of, may_change, refused
from compd.page.workbench.handlers import Handler, plain
from compd.page.workbench.open_workbench import OpenWorkbench

_QUESTIONS = "compd.page.workbench.formula_questions:"


async def _form(request: Request, workbench: OpenWorkbench) -> Response:
    return plain(await workbench.ask(f"{_QUESTIONS}form"))


async def _check(request: Request, workbench: OpenWorkbench) -> Response:
    """Allowed to everyone, since it changes nothing."""
    declaration = _declaration(await keys_of(request))
    return plain(await workbench.ask(f"{_QUESTIONS}checked", declaration))


async def _save(request: Request, workbench: OpenWorkbench) -> Response:
    """Save an effect, or with `delete` remove one; the answer is the summary."""
    keys = await keys_of(request)
    if not may_change(request):
        return refused(LOOKS_ONLY, 403)
    if "delete" in keys:
        return plain(await workbench.ask(f"{_QUESTIONS}deleted", str(keys["delete"])))
    return plain(await workbench.ask(f"{_QUESTIONS}saved", _declaration(keys), keys.get("replace") is True))


def _declaration(keys: Mapping[str, Any]) -> dict[str, Any]:
    """The effect in a request. Raises HTTPException for any other body, StateError for text that no file can hold."""
    declaration = keys.get("declaration")
    if not isinstance(declaration, dict):
        raise HTTPException(400, "declaration is a mapping: id, port, formula ...")
    try:
        json.dumps(declaration, ensure_ascii=False).encode()
    except UnicodeEncodeError as error:
        what = "an invalid character, which no file can hold"
        raise StateError(Problem(where="formula", what=what, next_step="type it anew")) from error
    return declaration


FORMULA_HANDLERS = (
    Handler("/formula", _form),
    Handler("/formula", _check, "POST"),
    Handler("/own", _save, "POST"),
)
