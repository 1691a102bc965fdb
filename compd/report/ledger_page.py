"""The ledger of a model file as a page: each step that changed the model, and how the error fell."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from plotly.graph_objects import Figure, Scatter

from compd.display_unit import format_error
from compd.model_file import StoredModel
from compd.report.ledger_table import LEDGER_HEAD, ledger_rows
from compd.report.page import COLOURS, Panel, style_figure, write_page
from compd.report.page_table import PageTable


def write_ledger_page(path: Path, model: StoredModel) -> None:
    """Write the page: the error after each step, and the steps. The model has one step or more."""
    steps = model.steps
    labels = ["at the start", *(f"{k}. {step.kind}<br>{step.effect or 'all'}" for k, step in enumerate(steps, start=1))]
    rms_um = [steps[0].rms_before_um, *(step.rms_after_um for step in steps)]
    floors_um = [steps[0].noise_floor_um, *(step.noise_floor_um for step in steps)]
    first, last = steps[0], steps[-1]
    verdict = (
        f"After {len(steps)} steps the residual is {format_error(last.rms_after_um, last.unit, 3)}; it was "
        f"{format_error(first.rms_before_um, first.unit, 3)}. "
        f"Noise alone would be {format_error(last.noise_floor_um, last.unit, 3)}."
    )
    unit = " or ".join(dict.fromkeys(step.unit for step in steps))
    panels = [
        Panel(
            "The falling error",
            "Residual after each step, on the recording it was fitted on.",
            plot_error_by_step(labels, rms_um, floors_um, unit),
        ),
        Panel(
            "Every step",
            "Each can be taken back with `compd model undo`.",
            PageTable(LEDGER_HEAD, ledger_rows(model)),
        ),
    ]
    write_page(path, f"Ledger: {model.machine}", verdict, panels, "")


def plot_error_by_step(
    labels: Sequence[str], rms_um: Sequence[float], floors_um: Sequence[float], unit: str = "um"
) -> Figure:
    """The error after each step of a model, and the noise floor that it cannot fall below; unit : in place of um."""
    figure = Figure()
    figure.add_trace(
        Scatter(
            x=list(labels),
            y=list(floors_um),
            mode="lines",
            name="noise floor",
            line={"color": COLOURS["worst"], "dash": "dash"},
        )
    )
    figure.add_trace(
        Scatter(
            x=list(labels),
            y=list(rms_um),
            mode="lines+markers+text",
            name="residual",
            text=[f"{value:.3g}" for value in rms_um],
            textposition="top center",
            line={"color": COLOURS["plain"], "width": 3},
            marker={"size": 9},
        )
    )
    style_figure(figure, "", f"residual, {unit} rms per coordinate", 420)
    ends = np.log10([0.7 * min(*rms_um, *floors_um), 1.6 * max(*rms_um, *floors_um)])
    return figure.update_yaxes(type="log", dtick="D2", tickformat=".3~g", range=ends.tolist()).update_layout(
        margin={"b": 90}, xaxis={"tickangle": 0}
    )
