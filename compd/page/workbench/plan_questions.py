"""Questions to a workbench in its worker about the next measurement: the choices, the plan, and its files."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Any, get_args

import numpy as np

from compd.api import plan_measurement
from compd.comparison import AlignedRecording
from compd.errors import CompdError
from compd.model.effects import Effect
from compd.page.workbench.formula_check import words
from compd.page.workbench.plan_endings import ENDINGS
from compd.page.workbench.plan_request import PlanRequest, field_of, read_request
from compd.page.workbench.workbench import Workbench
from compd.plan_file import TIP_COLUMNS
from compd.planning import DWELL_S, MeasurementPlan, PlanFormat, recorded_limits, recorded_settings

# Most plans whose files can still be downloaded.
_MAX_KEPT = 8


def form(workbench: Workbench, names: Sequence[str]) -> dict[str, Any]:
    """Effects to choose from, and limits. names : ids of rivals, on which the limits of an external model depend."""
    library = workbench.candidates.library
    effects = [entry["effect"] for entry in workbench.candidates.ranked() if entry["status"] != "not_testable"]
    chosen = [library[name] for name in names if name in effects]
    return {"effects": effects, "limits": limits_of(workbench.opened.aligned, chosen)}


def limits_of(aligned: AlignedRecording, effects: list[Effect]) -> dict[str, Any]:
    """Ranges of the recording by the fields of the form; by column for an external model."""
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


def planned(workbench: Workbench, libraries: Sequence[str], keys: dict[str, Any]) -> dict[str, Any]:
    """The plan, or the problems of each field. libraries : the chosen ones. keys : of the browser's request."""
    workbench.look_again(libraries)
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


def _plan_contents(plan: MeasurementPlan, workbench: Workbench, asked: PlanRequest) -> dict[str, Any]:
    """The plan as plain data; `key` gives access to its files."""
    columns = list(plan.rows[0]) if plan.rows else []
    key = hashlib.sha256(repr((plan.rivals, plan.rows)).encode()).hexdigest()[:16]
    workbench.plans.pop(key, None)
    workbench.plans[key] = plan
    for oldest in list(workbench.plans)[:-_MAX_KEPT]:
        del workbench.plans[oldest]
    placed = all(name in columns for name in TIP_COLUMNS)
    return {
        "key": key,
        "rivals": plan.rivals,
        "summary": plan.summary,
        "instructions": plan.instructions,
        "before": plan.before,
        "separation": plan.separation,
        "enough": plan.criteria.min_separation,
        "tells_apart": plan.tells_apart,
        "alike": plan.alike,
        "columns": columns,
        "rows": [[row[name] for name in columns] for row in plan.rows],
        "place": [[row[name] for name in TIP_COLUMNS] for row in plan.rows] if placed else [],
        "difference_um": [list(row) for row in plan.difference_um],
        "files": {
            shape: f"{workbench.opened.path.stem}-{ENDINGS[shape]}"
            for shape in get_args(PlanFormat)
            if plan.rows and (placed or shape in ("plan", "csv"))
        },
        "command": workbench.commands.plan(workbench.sources.paths_of([*asked.rivals, *asked.beside]), asked.options()),
    }


def file(workbench: Workbench, key: str, shape: PlanFormat, feed: float | None, dwell_s: float | None) -> bytes:
    """A plan as a file. feed : mm/min, and dwell_s : s, of G-code. Raises KeyError if it is no longer kept."""
    plan = workbench.plans[key]
    if not plan.rows:
        raise KeyError(key)
    return plan.text(shape, feed, DWELL_S if dwell_s is None else dwell_s).encode()
