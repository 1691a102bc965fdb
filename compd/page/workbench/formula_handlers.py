"""What a browser asks while a person writes an effect: what a formula may name, what is wrong with it, to keep it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import partial
from typing import Any, get_args

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from compd.errors import Problem, StateError
from compd.model.effect import PORTS
from compd.model.effect_basis import port_size
from compd.model.effect_needs import external_ports
from compd.model.formula.basis import AXES, VECTORS
from compd.model.formula.columns import ANYWHERE, OF_LINK, OF_READING, PER_LINK, column_needs, link_column
from compd.model.formula.functions import FUNCTIONS, LAG, NUMBERS
from compd.model.formula.keys import FormulaDeclaration
from compd.model.formula.parser import LONGEST
from compd.model.observations import Observations
from compd.page.requests import LOOKS_ONLY, answer, keys_of, may_change, refused
from compd.page.workbench.formula_check import check
from compd.page.workbench.handlers import Handler
from compd.page.workbench.workbench import Workbench

_NUMBERS = {"pi": "3.14159...", "deg": "radians in a degree"}


def offered(rows: Observations) -> dict[str, Any]:
    """What a formula on this recording may consist of: ports, columns by port, functions; as plain data."""
    known = "kinematics" in rows.available
    ports = [
        port
        for port in get_args(FormulaDeclaration.model_fields["port"].annotation)
        if (port_size(port, rows) > 0 if known else port in external_ports(rows.links))
    ]
    return {
        "ports": [
            {
                "port": port,
                "meaning": PORTS[port],
                "axes": AXES if port in VECTORS else [],
                "per_link": port in PER_LINK,
                "columns": _columns(rows, port),
            }
            for port in ports
        ],
        "functions": [
            *({"name": function.call, "meaning": function.meaning} for function in FUNCTIONS.values()),
            {"name": LAG[0], "meaning": LAG[1]},
            *({"name": name, "meaning": _NUMBERS[name]} for name in NUMBERS),
        ],
        "longest": LONGEST,
    }


def _columns(rows: Observations, port: Any) -> list[dict[str, str]]:
    """The columns that a formula at this port may name on these rows."""
    meanings = {**ANYWHERE, **OF_READING, **OF_LINK}
    meanings["temperature_link"] = meanings["temperature_link"].partition(";")[0]
    names = dict.fromkeys([*meanings, *map(link_column, rows.quantities), *rows.quantities])
    return [
        {"name": name, "meaning": meanings.get(name, "as measured")}
        for name in names
        if not isinstance(needs := column_needs(name, port), Problem) and all(_is_met(need, rows) for need in needs)
    ]


def _is_met(need: str, rows: Observations) -> bool:
    if need == "force":
        return all(f"force_{axis}_N" in rows.quantities for axis in AXES)
    return all(need.format(link=i + 1) in rows.available for i in range(rows.links or 1))


async def _form(request: Request, workbench: Workbench) -> Response:
    def form() -> dict[str, Any]:
        own = workbench.sources.own
        return {
            **offered(workbench.opened.aligned.rows),
            "file": str(own.path),
            "saved": list(own.declarations.values()),
            "problems": [str(problem) for problem in own.problems],
        }

    return answer(await workbench.ask(form))


async def _check(request: Request, workbench: Workbench) -> Response:
    """It changes nothing, so that everybody may."""
    declaration = _declaration(await keys_of(request))

    def checked() -> dict[str, Any]:
        opened = workbench.opened
        present = [fitted.effect.id for fitted in opened.model.fitted]
        result = check(declaration, opened.aligned.rows, present)
        if result.effect is None or result.problems:
            return result.as_json()
        name = workbench.drafts.add(result.effect)
        (ranked,) = workbench.drafts.find(name)[0].ranked()
        return {**result.as_json(), "draft": {**ranked, "effect": name}}

    return answer(await workbench.ask(checked))


async def _save(request: Request, workbench: Workbench) -> Response:
    """Keep an effect, or with `delete` take one out; the answer is the summary."""
    keys = await keys_of(request)
    if not may_change(request):
        return refused(LOOKS_ONLY, 403)
    if "delete" in keys:
        await workbench.ask(partial(workbench.sources.own.delete, str(keys["delete"])))
    else:
        await workbench.ask(partial(workbench.sources.own.save, _declaration(keys), keys.get("replace") is True))
    return JSONResponse(await workbench.ask(workbench.summary))


def _declaration(keys: Mapping[str, Any]) -> dict[str, Any]:
    """The effect in a request. Raises HTTPException for anything else, StateError for what no file can hold."""
    declaration = keys.get("declaration")
    if not isinstance(declaration, dict):
        raise HTTPException(400, "declaration is a mapping: id, port, formula ...")
    try:
        json.dumps(declaration, ensure_ascii=False).encode()
    except UnicodeEncodeError as error:
        what = "a character that is none, which no file can hold"
        raise StateError(Problem(where="formula", what=what, next_step="type it anew")) from error
    return declaration


FORMULA_HANDLERS = (
    Handler("/formula", _form),
    Handler("/formula", _check, "POST"),
    Handler("/own", _save, "POST"),
)
