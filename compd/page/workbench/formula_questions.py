"""Questions to a workbench in its worker about effects being written: names for formulas, problems."""

from __future__ import annotations

from typing import Any, get_args

from compd.errors import Problem
from compd.link_count import scale_count
from compd.model.effects import PORTS, Observations, external_ports, port_size
from compd.model.formula import (
    ANYWHERE,
    AXES,
    FUNCTIONS,
    LAG,
    LONGEST,
    NUMBERS,
    OF_LINK,
    OF_READING,
    PER_LINK,
    VECTORS,
    FormulaDeclaration,
    column_needs,
    link_column,
)
from compd.page.workbench.formula_check import check
from compd.page.workbench.workbench import Workbench

_NUMBERS = {"pi": "3.14159...", "deg": "radians in a degree"}


def offered(rows: Observations) -> dict[str, Any]:
    """Elements of a formula on this recording: ports, columns by port, functions; as plain data."""
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
    places = scale_count(rows.links) if "{scale}" in need else rows.links
    return all(need.format(link=i + 1, scale=i + 1) in rows.available for i in range(places or 1))


def form(workbench: Workbench) -> dict[str, Any]:
    """Elements of a formula, and the saved effects."""
    own = workbench.sources.own
    return {
        **offered(workbench.opened.aligned.rows),
        "file": str(own.path),
        "saved": list(own.declarations.values()),
        "problems": [str(problem) for problem in own.problems],
    }


def checked(workbench: Workbench, declaration: dict[str, Any]) -> dict[str, Any]:
    """Problems of an effect; a valid one is tried under the name of a draft."""
    opened = workbench.opened
    present = [fitted.effect.id for fitted in opened.model.fitted]
    result = check(declaration, opened.aligned.rows, present)
    if result.effect is None or result.problems:
        return result.as_json()
    name = workbench.drafts.add(result.effect)
    (ranked,) = workbench.drafts.find(name)[0].ranked()
    return {**result.as_json(), "draft": {**ranked, "effect": name}}


def saved(workbench: Workbench, declaration: dict[str, Any], replace: bool) -> dict[str, Any]:
    """Save an effect; return the summary. Raises as `OwnEffects.save`."""
    workbench.sources.own.save(declaration, replace)
    return workbench.summary()


def deleted(workbench: Workbench, effect: str) -> dict[str, Any]:
    """Remove a saved effect; return the summary. Raises as `OwnEffects.delete`."""
    workbench.sources.own.delete(effect)
    return workbench.summary()
