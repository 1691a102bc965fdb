"""A diagnosis as a page: the twelve lines, the falling error, the picture of each effect, every candidate, what comes
next."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from pathlib import Path

import numpy as np

from compd.diagnosis import Diagnosis, EmpiricalFinding, ErrorFall, Holdout, error_fall, summary_lines
from compd.model.effects import FittedEffect
from compd.model.library import find_effect
from compd.report.diagnosis_evidence import (
    candidates_table,
    constant_table,
    described_by,
    findings_table,
    formula_list,
    gross_rows_text,
    next_table,
    step_rows,
    untested_table,
    without_gain,
)
from compd.report.falling_error import CAPTION, plot_falling_error
from compd.report.page import PageText, Panel, write_page
from compd.report.page_table import PageTable
from compd.report.step_figure import plot_step
from compd.report.time_figure import plot_time


def write_diagnosis_page(
    path: Path, diagnosis: Diagnosis, holdouts: Sequence[Holdout], shared_script: bool = False, recorded_rows: int = 0
) -> None:
    """Write the page; it works offline.

    shared_script : as in `write_page`.  recorded_rows : of the file, where a sample of it was diagnosed.
    """
    recording = diagnosis.before.aligned.recording
    fall = error_fall(diagnosis)
    panels = [
        Panel("The falling error", CAPTION, plot_falling_error(diagnosis, holdouts, fall)),
        *_step_panels(diagnosis, fall),
        *_time_panels(diagnosis, fall),
        *_description_panels(diagnosis, fall),
        *_table_panels(diagnosis, fall),
    ]
    sample = f"a sample of {recording.rows} rows of {recorded_rows}, spread evenly; " if recorded_rows else ""
    footer = (
        f"{recording.path}, sha256 {recording.sha256[:16]}; {sample}{int(diagnosis.after.used.sum())} rows used; "
        f"noise floor: {diagnosis.before.floor.how}."
    )
    title = f"Diagnosis of {recording.machine}: {diagnosis.verdict}"
    write_page(path, title, PageText("\n".join(summary_lines(diagnosis))), panels, footer, shared_script)


def _step_panels(diagnosis: Diagnosis, fall: ErrorFall) -> list[Panel]:
    """Picture and numbers of each effect."""
    panels = []
    for number, step in enumerate(diagnosis.steps):
        figure, caption = plot_step(diagnosis.after, [step.fitted], fall)
        panels += [
            Panel(f"{number + 1}. {step.effect.id}: {step.effect.physics}", caption, figure),
            Panel(f"{step.effect.id}: its numbers", "", PageTable(("", ""), step_rows(number, diagnosis, fall))),
        ]
    return panels


def _time_panels(diagnosis: Diagnosis, fall: ErrorFall) -> list[Panel]:
    """Gross rows and changes in time, if any."""
    if not diagnosis.gross.rows and not any(finding.is_change for finding in diagnosis.depends_on):
        return []
    caption = "The error that is left; dashed lines are changes."
    if diagnosis.gross.rows:
        caption += f" Crosses at the edge lie beyond it: {gross_rows_text(diagnosis, fall)}."
    return [Panel("Over time", caption, plot_time(diagnosis, fall))]


def _description_panels(diagnosis: Diagnosis, fall: ErrorFall) -> list[Panel]:
    """Descriptions of the rest: a picture for each covariate of the best one, all descriptions, the formulas."""
    if not diagnosis.depends_on:
        return []
    table = findings_table(diagnosis, fall)
    panels = [Panel("What the rest follows", "Descriptions, no causes; on rows that were left out.", table)]
    finding = described_by(diagnosis)
    if finding is None:
        return panels
    by_covariate = _described(finding, diagnosis)
    described = list(chain.from_iterable(by_covariate.values()))
    for covariate, effects in by_covariate.items():
        figure, caption = plot_step(diagnosis.after, effects, fall, described)
        panels.append(Panel(f"With and without {covariate}", caption, figure))
    caption = (
        "To lower the error until the cause is known: a file of effects, as `compd effect add FILE.yaml:ID` and "
        "`compd diagnose --effects FILE.yaml` take it."
    )
    return [*panels, Panel("As formulas", caption, PageText(formula_list(diagnosis)))]


def _described(finding: EmpiricalFinding, diagnosis: Diagnosis) -> dict[str, list[FittedEffect]]:
    """The formulas of a finding with their numbers, by the covariate that they follow."""
    links = diagnosis.after.aligned.rows.links
    by_covariate: dict[str, list[FittedEffect]] = {}
    for declaration, numbers in zip(finding.formula_effects, finding.parameters, strict=True):
        effect = find_effect(declaration, "what the rest follows")
        theta = np.array([numbers[column.name] for column in effect.columns(links)])
        names = [name for name in (finding.covariate, *finding.beside) if name in effect.equation]
        by_covariate.setdefault(names[0] if names else finding.covariate, []).append(FittedEffect(effect, theta))
    return by_covariate


def _table_panels(diagnosis: Diagnosis, fall: ErrorFall) -> list[Panel]:
    """The constant, every candidate, and what to measure next."""
    panels = []
    constant, coming = constant_table(diagnosis, fall), next_table(diagnosis)
    if constant is not None:
        panels.append(Panel("A constant in every row", "No effect is judged by it.", constant))
    tried, untested = candidates_table(diagnosis, fall), untested_table(diagnosis)
    names = without_gain(diagnosis)
    if tried.rows:
        panels.append(Panel("Effects that were tried", "Each tried alone, on rows left out.", tried))
    if names:
        panels.append(Panel("Without gain", "", PageTable(("",), [[", ".join(names)]])))
    if untested.rows:
        panels.append(Panel("Effects that these rows cannot test", "", untested))
    if coming is not None:
        planned = "measure" not in coming.head
        text = f"Rows that tell the most. {coming.caption}".rstrip() if planned else ""
        panels.append(Panel("What to measure next", text, coming))
    return panels
