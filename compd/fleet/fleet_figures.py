"""Figures of a fleet: parameters over campaigns, and errors beside the noise."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from plotly.graph_objects import Figure, Scatter
from plotly.subplots import make_subplots

from compd.fleet.drift import Drift
from compd.fleet.overview import Overview, short_name
from compd.report import COLOURS, COLUMNS, SERIES_COLOURS, PageTable, style_figure

NO_DRIFTS = PageTable(("",), [("no parameter has been determined on enough campaigns of one machine",)])
# Most small figures of a page; the table has all numbers.
MAX_PANELS = 9
PANEL_PX = 260
# Most machines with a colour of their own in one small figure; beyond it only drifting ones have one.
MAX_COLOURED = len(SERIES_COLOURS)


def plot_drifts(overview: Overview) -> Figure | PageTable:
    """A small figure for each parameter: its value on each campaign of each machine, and the lines of drifts.

    Those that drift come first, then those that most machines have; at most MAX_PANELS, and only parameters with
    enough campaigns to show a drift. NO_DRIFTS where there is none.
    """
    by_name = _panels(overview)
    if not by_name:
        return NO_DRIFTS
    lines, across = -(-len(by_name) // COLUMNS), min(COLUMNS, len(by_name))
    figure = make_subplots(
        lines,
        across,
        subplot_titles=[name for name, _ in by_name],
        vertical_spacing=min(0.45 / lines, 0.3),
        horizontal_spacing=0.09,
    )
    style_figure(figure, "", "", 80 + PANEL_PX * lines).update_layout(
        legend={"y": 1 + 45 / (PANEL_PX * lines), "itemsizing": "constant"}, margin={"t": 70}
    ).update_annotations(font_size=14)
    coloured = _coloured(overview)
    shown: set[str] = set()
    for k, ((_, unit), series) in enumerate(by_name.items()):
        row, col = k // across + 1, k % across + 1
        # quiet ones first, so that the others lie over them
        for drift in sorted(series, key=lambda drift: drift.machine in coloured):
            colour = coloured.get(drift.machine, COLOURS["quiet"])
            legend = drift.machine in coloured and drift.machine not in shown
            shown.add(drift.machine)
            for trace in _traces(drift, colour, legend):
                figure.add_trace(trace, row=row, col=col)
        dated = all(drift.started_at for drift in series)
        figure.update_xaxes(
            title_text="" if dated else "campaign", title_standoff=4, nticks=4, tickangle=0, row=row, col=col
        )
        figure.update_yaxes(title_text=unit if unit != "1" else "", row=row, col=col)
    return figure


def _panels(overview: Overview) -> dict[tuple[str, str], list[Drift]]:
    """(Parameter, unit) -> its values on every machine, of the parameters that have a figure, in their order."""
    by_name: dict[tuple[str, str], list[Drift]] = {}
    for drift in overview.drifts:
        by_name.setdefault((drift.name, drift.unit), []).append(drift)
    shown = [
        (min(drift.p_value for drift in tried) if any(drift.named for drift in tried) else 1.0, -len(tried), key)
        for key, series in by_name.items()
        if (tried := [drift for drift in series if not math.isnan(drift.p_value)])
    ]
    return {key: by_name[key] for _, _, key in sorted(shown)[:MAX_PANELS]}


def plot_errors(overview: Overview) -> Figure | PageTable:
    """The error of each recording by machine, before and with its effects, and the noise alone."""
    kinds: Sequence[tuple[str, str, dict[str, Any]]] = (
        ("error", "rms_before_um", {"color": COLOURS["worst"], "size": 7, "opacity": 0.7}),
        ("with its effects", "rms_after_um", {"color": COLOURS["best"], "size": 7, "opacity": 0.7}),
        ("noise alone", "noise_floor_um", {"color": COLOURS["quiet"], "size": 10, "symbol": "line-ew-open"}),
    )
    units = sorted({result.error_unit for result in overview.examined})
    figure = Figure()
    for name, attribute, marker in kinds:
        results = [result for result in overview.examined if getattr(result, attribute) > 0]
        figure.add_trace(
            Scatter(
                x=[result.machine for result in results],
                y=[getattr(result, attribute) for result in results],
                mode="markers",
                name=name,
                marker=marker,
                text=[short_name(result) for result in results],
                hovertemplate="%{text}: %{y:.3g}<extra>" + name + "</extra>",
            )
        )
    style_figure(figure, "", f"error, {' or '.join(units)} rms per coordinate", 420)
    figure.update_xaxes(categoryorder="array", categoryarray=overview.machines, automargin=True)
    return figure.update_yaxes(type="log", dtick="D2", tickformat=".3~g")


def _coloured(overview: Overview) -> dict[str, str]:
    """Machine -> its colour: all where they are few, else those that drift or differ, as far as colours go."""
    machines = overview.machines
    if len(machines) > MAX_COLOURED:
        named = [drift.machine for drift in overview.drifts if drift.named]
        named += [outlying.machine for outlying in overview.outlying]
        machines = list(dict.fromkeys(named))
    return dict(zip(machines, SERIES_COLOURS, strict=False))


def _traces(drift: Drift, colour: str, legend: bool) -> list[Scatter]:
    """The values with their standard errors, and where it is named the line."""
    x = list(drift.started_at) or drift.time.tolist()
    values = Scatter(
        x=x,
        y=drift.value,
        error_y={"array": drift.standard_error, "color": colour, "thickness": 1, "width": 3},
        mode="markers",
        marker={"color": colour, "size": 6},
        name=drift.machine,
        legendgroup=drift.machine,
        showlegend=legend,
        hovertemplate=f"{drift.machine}: %{{y:.4g}} {drift.unit}<extra></extra>",
    )
    if not drift.named:
        return [values]
    line = Scatter(
        x=[x[0], x[-1]],
        y=[drift.intercept + drift.slope * float(drift.time[k]) for k in (0, -1)],
        mode="lines",
        line={"color": colour, "width": 2},
        legendgroup=drift.machine,
        showlegend=False,
        hoverinfo="skip",
    )
    return [values, line]
