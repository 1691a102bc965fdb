"""A diagnosis as a page: the twelve lines, the falling error, the picture of each effect, every candidate, what comes
next."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from pathlib import Path

import numpy as np
from plotly.graph_objects import Figure, Scatter
from plotly.subplots import make_subplots

from compd.arrays import FloatArray, IntArray
from compd.diagnosis import Diagnosis, EmpiricalFinding, ErrorFall, Holdout, change_text, error_fall, summary_lines
from compd.model.effects import FittedEffect
from compd.model.library import find_effect
from compd.recording import Recording
from compd.report.diagnosis_evidence import (
    candidates_table,
    constant_table,
    described_by,
    findings_table,
    formula_list,
    next_table,
    step_rows,
    untested_table,
    without_gain,
    wrong_data,
)
from compd.report.falling_error import CAPTION, plot_falling_error
from compd.report.page import COLOURS, PageText, Panel, style_figure, write_page
from compd.report.page_table import PageTable
from compd.report.small_multiples import SERIES_COLOURS, dot_style, thin
from compd.report.step_figure import plot_step
from compd.units import UNIT_KINDS

DOTS = 1500
ROW_PX = 210
# Gross rows are drawn at the edge beyond this multiple of the error that all but this share of the rows stay below.
EDGE, STRAY = 1.6, 0.002
SECONDS_PER_HOUR = UNIT_KINDS[1]["h"]
_CROSS = {"size": 9, "color": COLOURS["worst"], "symbol": "x-thin", "line": {"width": 2, "color": COLOURS["worst"]}}


def plot_time(diagnosis: Diagnosis, fall: ErrorFall) -> Figure:
    """The residual with all findings over time, or over rows if the time is unknown.

    Rows that count are dots, gross ones crosses, changes dashed lines.
    """
    after = diagnosis.after
    recording, labels = after.aligned.recording, after.aligned.labels
    x = _places(recording)
    used, gross = np.flatnonzero(after.used), np.flatnonzero(np.isin(recording.row, diagnosis.gross.rows))
    figure = make_subplots(len(labels), 1, shared_xaxes=True, vertical_spacing=0.06)
    style_figure(figure, "", "", 110 + ROW_PX * len(labels)).update_layout(margin={"t": 50}, showlegend=False)
    for k, label in enumerate(labels):
        values = after.residual_um[:, k]
        edge = EDGE * float(np.quantile(np.abs(values[used]), 1 - STRAY))
        _add_rows(figure, k, x, values, thin(used, DOTS))
        texts = [f"row {recording.row[row]}: {values[row]:.4g} {fall.unit}" for row in gross]
        shown = np.clip(np.nan_to_num(values[gross], nan=edge), -edge, edge)
        crosses = Scatter(x=x[gross], y=shown, mode="markers", marker=_CROSS, text=texts, hoverinfo="text")
        figure.add_trace(crosses, row=k + 1, col=1)
        span = [-1.08 * edge, 1.08 * edge]
        figure.update_yaxes(title_text=f"error in {label}, {fall.unit}", range=span, row=k + 1, col=1)
    for finding in [finding for finding in diagnosis.depends_on if finding.is_change]:
        moment = float(np.interp(finding.time_s, recording.time_s, x))
        figure.add_vline(moment, line={"dash": "dash", "color": COLOURS["quiet"]})
        text = change_text(finding, diagnosis)
        figure.add_annotation(x=moment, y=1, yref="paper", yanchor="bottom", text=text, showarrow=False)
    return figure.update_xaxes(title_text="time, h" if recording.has_time else "row", row=len(labels), col=1)


def _places(recording: Recording) -> FloatArray:
    """(N,) hours from the first row; rows in a recording without time."""
    return recording.elapsed_s / SECONDS_PER_HOUR if recording.has_time else recording.row.astype(np.float64)


def _add_rows(figure: Figure, k: int, x: FloatArray, values: FloatArray, rows: IntArray) -> None:
    """The rows that count, of coordinate k."""
    dots = Scatter(
        x=x[rows].astype(np.float32),
        y=values[rows].astype(np.float32),
        mode="markers",
        marker={**dot_style(len(rows)), "color": SERIES_COLOURS[k % len(SERIES_COLOURS)]},
        hovertemplate="%{y:.3g} at %{x:.4g}<extra></extra>",
    )
    figure.add_trace(dots, row=k + 1, col=1)


def write_diagnosis_page(
    path: Path, diagnosis: Diagnosis, holdouts: Sequence[Holdout], shared_script: bool = False
) -> None:
    """Write the page; it works offline. shared_script : as in `write_page`."""
    recording = diagnosis.before.aligned.recording
    fall = error_fall(diagnosis)
    panels = [
        Panel("The falling error", CAPTION, plot_falling_error(diagnosis, holdouts, fall)),
        *_step_panels(diagnosis, fall),
        *_data_panels(diagnosis, fall),
        *_time_panels(diagnosis, fall),
        *_description_panels(diagnosis, fall),
        *_table_panels(diagnosis, fall),
    ]
    footer = (
        f"{recording.path}, sha256 {recording.sha256[:16]}; {int(diagnosis.after.used.sum())} rows used; "
        f"noise floor: {diagnosis.before.floor.how}. {diagnosis.before.basis}".rstrip()
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


def _data_panels(diagnosis: Diagnosis, fall: ErrorFall) -> list[Panel]:
    """What is wrong with the data, if anything is."""
    texts = wrong_data(diagnosis, fall)
    return [Panel("What is wrong with the data", "", PageTable(("",), [[text] for text in texts]))] if texts else []


def _time_panels(diagnosis: Diagnosis, fall: ErrorFall) -> list[Panel]:
    """Gross rows and changes in time, if any."""
    if not diagnosis.gross.rows and not any(finding.is_change for finding in diagnosis.depends_on):
        return []
    caption = "The error that is left; dashed lines are changes."
    if diagnosis.gross.rows:
        caption += " Crosses at the edge lie beyond it: these rows do not count."
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
        "To lower the error until the cause is known: a file of effects, as `compd model add FILE.yaml:ID` and "
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
