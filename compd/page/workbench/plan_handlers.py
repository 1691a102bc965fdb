"""What a browser asks to plan the next measurement: what there is to choose, the plan, and its files."""

from __future__ import annotations

import hashlib
import math
from typing import Any, get_args

import numpy as np
from starlette.requests import Request
from starlette.responses import Response

from compd.api.measurements import plan_measurement
from compd.comparison.alignment.aligned_recording import AlignedRecording
from compd.diagnosis.planning.measurement_plan import MeasurementPlan
from compd.diagnosis.planning.measurement_programmes import recorded_limits
from compd.diagnosis.planning.plan_formats import DWELL_S, PlanFormat
from compd.diagnosis.planning.setting_programmes import recorded_settings
from compd.errors import CompdError, Problem
from compd.model.effect import Effect
from compd.page.requests import answer, keys_of, refused
from compd.page.workbench.formula_check import words
from compd.page.workbench.handlers import Handler
from compd.page.workbench.plan_request import PlanRequest, field_of, read_request
from compd.page.workbench.workbench import Workbench
from compd.recording.plan_file import TIP_COLUMNS

# Plans whose files can still be downloaded.
_MOST_KEPT = 8
# As the guide on planned measurements calls them.
_ENDINGS: dict[PlanFormat, str] = {"plan": "plan.csv", "sa": "targets.txt", "csv": "targets.csv", "gcode": "plan.ngc"}


async def _form(request: Request, workbench: Workbench) -> Response:
    """`rivals`: ids with commas, of which the limits of a machine of an external model depend."""
    names = [name for name in request.query_params.get("rivals", "").split(",") if name]

    def form() -> dict[str, Any]:
        library = workbench.candidates.library
        effects = [entry["effect"] for entry in workbench.candidates.ranked() if entry["status"] != "not_testable"]
        chosen = [library[name] for name in names if name in effects]
        return {"effects": effects, "limits": limits_of(workbench.opened.aligned, chosen)}

    return answer(await workbench.ask(form))


def limits_of(aligned: AlignedRecording, effects: list[Effect]) -> dict[str, Any]:
    """Within what the recording stayed, by the fields of the form; of an external model by column."""
    if aligned.model is None:
        columns = recorded_settings(aligned, effects) if effects else {}
        return {"columns": {name: [float(np.nanmin(v)), float(np.nanmax(v))] for name, v in columns.items()}}
    limits = recorded_limits(aligned)
    return {
        "workspace": np.stack([limits.tip_low_M_mm, limits.tip_high_M_mm], axis=1).tolist(),
        "force": limits.force_N,
        "temperature": list(limits.temperature_degC),
        "speed": limits.speed_mm_per_s,
    }


async def _plan(request: Request, workbench: Workbench) -> Response:
    """It changes nothing, so that everybody may."""
    keys = await keys_of(request)

    def planned() -> dict[str, Any]:
        try:
            asked = read_request(keys, workbench.candidates.library)
            plan = plan_measurement(
                workbench.opened.aligned,
                asked.rivals,
                rows=asked.rows,
                model=workbench.opened.model,
                effects=workbench.sources.effects,
                beside=asked.beside,
                workspace_M_mm=asked.workspace_M_mm,
                force_N=asked.force_N,
                temperature_degC=asked.temperature_degC,
                speed_mm_per_s=asked.speed_mm_per_s,
                limits=asked.limits,
            )
        except CompdError as error:
            problems = [{"field": field_of(problem), "text": words(problem)} for problem in error.problems]
            return {"problems": problems}
        return _plan_contents(plan, workbench, asked)

    return answer(await workbench.ask(planned))


def _plan_contents(plan: MeasurementPlan, workbench: Workbench, asked: PlanRequest) -> dict[str, Any]:
    """The plan as plain data; its files can be had under `key`."""
    columns = list(plan.rows[0]) if plan.rows else []
    key = hashlib.sha256(repr((plan.rivals, plan.rows)).encode()).hexdigest()[:16]
    workbench.plans.pop(key, None)
    workbench.plans[key] = plan
    for oldest in list(workbench.plans)[:-_MOST_KEPT]:
        del workbench.plans[oldest]
    placed = all(name in columns for name in TIP_COLUMNS)
    return {
        "key": key,
        "rivals": plan.rivals,
        "summary": plan.summary,
        "instructions": plan.instructions,
        "before": plan.before,
        "separation": plan.separation,
        "tells_apart": plan.tells_apart,
        "alike": plan.alike,
        "columns": columns,
        "rows": [[row[name] for name in columns] for row in plan.rows],
        "place": [[row[name] for name in TIP_COLUMNS] for row in plan.rows] if placed else [],
        "difference_um": [list(row) for row in plan.difference_um],
        "files": {
            shape: f"{workbench.opened.path.stem}-{_ENDINGS[shape]}"
            for shape in get_args(PlanFormat)
            if plan.rows and (placed or shape in ("plan", "csv"))
        },
        "command": workbench.commands.plan(workbench.sources.paths_of([*asked.rivals, *asked.beside]), asked.options()),
    }


async def _file(request: Request, workbench: Workbench) -> Response:
    """A plan as a file; `feed` (mm/min) and `dwell` (s) for G-code."""
    plan, shape = workbench.plans.get(request.path_params["key"]), request.path_params["format"]
    if plan is None or not plan.rows or shape not in get_args(PlanFormat):
        return refused("this plan is not kept any more: plan again", 404)
    feed, dwell_s = _query_number(request, "feed", 0.1), _query_number(request, "dwell", 0.0)
    text = plan.text(shape, feed, DWELL_S if dwell_s is None else dwell_s)
    name = f"{request.path_params['recording']}-{_ENDINGS[shape]}"
    return Response(text, media_type="text/plain", headers={"Content-Disposition": f'attachment; filename="{name}"'})


def _query_number(request: Request, name: str, least: float) -> float | None:
    """A number of the address; None where it has none. Raises CompdError for anything else."""
    text = request.query_params.get(name, "")
    if not text:
        return None
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not least <= value < math.inf:
        raise CompdError(Problem(where=name, what="is not understood", value=text[:80], allowed=f"{least:g} or more"))
    return value


PLAN_HANDLERS = (
    Handler("/plan", _form),
    Handler("/plan", _plan, "POST"),
    Handler("/plan/{key}/{format}", _file),
)
