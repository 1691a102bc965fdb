"""The page of a demo session, with pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from plotly.graph_objects import Box, Figure, Histogram, Scatter
from rich.console import Group, RenderableType
from rich.progress_bar import ProgressBar
from rich.table import Table as TerminalTable

from compd.demo.session import ATTEMPTS, KINDS, DemoSession
from compd.report import AXIS_COLOURS, COLOURS, PageTable, Panel, style_figure, write_page
from compd.units import UM_PER_MM

LABELS = {"none": "no compensation", "joints": "joints only", "full": "joints and frame"}


def error_rows(session: DemoSession) -> list[list[str]]:
    """Tip error against the truth: rms, 95 % and largest distance, by kind of compensation."""
    rows = []
    for kind in KINDS:
        errors = [visit.error_um[kind] for visit in session.visits]
        p95, largest = (float(np.percentile(errors, 95)), max(errors)) if errors else (float("nan"),) * 2
        rows.append([LABELS[kind], f"{session.rms_um(kind):.2f} um", f"{p95:.2f} um", f"{largest:.2f} um"])
    return rows


LOOP_ROWS = {
    "rate_hz": "loop rate, Hz",
    "cycles": "cycles",
    "missed_cycles": "missed cycles",
    "period_mean_ms": "period, mean, ms",
    "period_deviation_ms": "period, standard deviation, ms",
    "lateness_median_us": "wake-up lateness, median, us",
    "lateness_p99_us": "wake-up lateness, 99 %, us",
    "cycle_median_us": "time per cycle, median, us",
}


def timing_rows(session: DemoSession) -> list[list[str]]:
    """The loop's period and the gauges' ages, from the daemon's STATUS and its setpoints."""
    loop = session.status.get("loop", {})
    rows = [[label, f"{loop[key]:.4g}"] for key, label in LOOP_ROWS.items() if key in loop]
    ages = [message["age_s"] * 1e3 for message in session.setpoints if "age_s" in message]
    if ages:
        rows.append(["age of the oldest gauge, median, ms", f"{np.median(ages):.1f}"])
        rows.append(["age of the oldest gauge, largest, ms", f"{max(ages):.1f}"])
    return rows


def progress(session: DemoSession, elapsed_s: float, seconds: float, setpoint: dict[str, Any]) -> RenderableType:
    """The live table: the newest points, and the setpoint in force."""
    title = f"distance of the true tip from its target, um; {len(session.visits)} points"
    table = TerminalTable(title=title)
    for head in ("s", "target, mm", "without", "joints", "joints, frame"):
        table.add_column(head, justify="right", no_wrap=True)
    for visit in session.visits[-10:]:
        table.add_row(
            f"{visit.time_s:.1f}",
            " ".join(f"{x:6.1f}" for x in visit.target_mm),
            *(f"{visit.error_um[kind]:.2f}" for kind in KINDS),
        )
    correction = " ".join(f"{value * UM_PER_MM:+.2f}" for value in setpoint.get("correction_mm", []))
    line = f"setpoint {setpoint['seq']}: {setpoint['state']} {setpoint['reason']}  correction {correction} um"
    return Group(table, line, ProgressBar(total=seconds, completed=min(elapsed_s, seconds), width=60))


def summarise(session: DemoSession) -> RenderableType:
    """The tables at the end of the demo."""
    errors = TerminalTable(
        "tip error against the truth",
        "rms",
        "95 %",
        "largest",
        title=f"{session.machine}: {len(session.visits)} points measured at rest",
    )
    for row in error_rows(session):
        errors.add_row(*row)
    timing = TerminalTable("loop and gauges", "")
    for row in timing_rows(session):
        timing.add_row(*row)
    return Group(errors, timing)


def verdict(session: DemoSession) -> str:
    """The result in one sentence."""
    if session.shortcoming:
        return f"The demo gave no result on this computer in {ATTEMPTS} attempts: {session.shortcoming}."
    rms_um = {kind: session.rms_um(kind) for kind in KINDS}
    return (
        f"At {len(session.visits)} points the tip missed its target by {rms_um['none']:.1f} um (rms) without "
        f"compensation, by {rms_um['joints']:.1f} um with the joints compensated, and by {rms_um['full']:.2f} um "
        "with joints and frame compensated."
    )


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
