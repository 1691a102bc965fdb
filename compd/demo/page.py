"""The page of a demo session, with pictures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from plotly.graph_objects import Box, Figure, Histogram, Scatter

from compd.demo.session import KINDS, DemoSession
from compd.demo.summary import LABELS, error_rows, timing_rows, verdict
from compd.report import AXIS_COLOURS, COLOURS, PageTable, Panel, style_figure, write_page
from compd.units import UM_PER_MM

KIND_COLOURS = {"none": COLOURS["worst"], "joints": COLOURS["middle"], "full": COLOURS["best"]}


def write_demo_page(path: Path, session: DemoSession) -> None:
    """The page: verdict, tables, pictures."""
    panels = [
        Panel(
            "Error of the tool tip",
            "Distance between the true tip and its target, machine at rest.",
            PageTable(("", "rms", "95 %", "largest"), error_rows(session)),
        ),
        Panel(
            "Error while the machine warms up",
            "One dot per point. The frame grows as it warms, so the uncompensated error grows; what the frame "
            "comparators see is taken out.",
            _errors(session),
        ),
        Panel(
            "What the correction is made of",
            "Correction of each link's command at the end of each visit, by source.",
            _sources(session),
        ),
        Panel("How the frame moved", "Position of the base platform {B} since machine zero, in {M}.", _frame(session)),
        Panel("Age of the oldest gauge", "Every setpoint says how old its oldest reading is.", _ages(session)),
        Panel("Spread by kind", "The same errors side by side; the scale is logarithmic.", _spread(session)),
        Panel("Loop", "As the daemon's STATUS tells it.", PageTable(("", "value"), timing_rows(session))),
    ]
    footer = "Simulated machine, gauges on real ptys and TCP ports; the truth shares no code with the model."
    write_page(path, f"compd demo: {session.machine}", verdict(session), panels, footer)


def _times(session: DemoSession) -> list[float]:
    return [visit.time_s for visit in session.visits]


def _errors(session: DemoSession) -> Figure:
    figure = Figure()
    for kind in KINDS:
        figure.add_scatter(
            x=_times(session),
            y=[visit.error_um[kind] for visit in session.visits],
            name=LABELS[kind],
            mode="lines+markers",
            line={"color": KIND_COLOURS[kind]},
        )
    return style_figure(figure, "time since the start, s", "tip error, um")


def _sources(session: DemoSession) -> Figure:
    figure = Figure()
    causes = list(session.visits[-1].setpoint["sources_mm"]) if session.visits else []
    shades = dict(zip(causes, [COLOURS["plain"], COLOURS["middle"], COLOURS["quiet"]], strict=False))
    for cause in causes:
        per_link = np.array([visit.setpoint["sources_mm"][cause] for visit in session.visits]) * UM_PER_MM
        for link in range(per_link.shape[1]):
            figure.add_trace(
                Scatter(
                    x=_times(session),
                    y=per_link[:, link],
                    name=cause,
                    legendgroup=cause,
                    showlegend=link == 0,
                    mode="lines+markers",
                    marker={"size": 4},
                    line={"color": shades.get(cause, COLOURS["quiet"])},
                    hovertemplate=f"{cause}, link {link + 1}: %{{y:.2f}} um",
                )
            )
    return style_figure(figure, "time since the start, s", "correction, um")


def _frame(session: DemoSession) -> Figure:
    figure = Figure()
    displacements = [
        (message["time_s"], message["frame"]["displacement_M_mm"])
        for message in session.setpoints
        if "frame" in message
    ]
    start_s = displacements[0][0] if displacements else 0.0
    for axis, name in enumerate(AXIS_COLOURS):
        figure.add_scatter(
            x=[time_s - start_s for time_s, _ in displacements],
            y=[displacement_mm[axis] * UM_PER_MM for _, displacement_mm in displacements],
            name=name,
            mode="lines",
            line={"color": AXIS_COLOURS[name]},
        )
    return style_figure(figure, "time since the start, s", "displacement of {B}, um")


def _ages(session: DemoSession) -> Figure:
    ages = [message["age_s"] * 1e3 for message in session.setpoints if "age_s" in message]
    return style_figure(
        Figure(Histogram(x=ages, marker_color=COLOURS["plain"])), "age of the oldest gauge, ms", "setpoints"
    )


def _spread(session: DemoSession) -> Figure:
    figure = Figure()
    for kind in KINDS:
        figure.add_trace(
            Box(
                y=[visit.error_um[kind] for visit in session.visits],
                name=LABELS[kind],
                boxpoints="all",
                marker_color=KIND_COLOURS[kind],
                showlegend=False,
            )
        )
    figure.update_yaxes(type="log", dtick=1)
    return style_figure(figure, "", "tip error, um")
