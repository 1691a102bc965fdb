"""The picture of the error over time, with gross rows and the times of changes."""

from __future__ import annotations

import numpy as np
from plotly.graph_objects import Figure, Scatter
from plotly.subplots import make_subplots

from compd.arrays import FloatArray, IntArray
from compd.diagnosis import Diagnosis, ErrorFall, change_text
from compd.recording import Recording
from compd.report.page import COLOURS, style_figure
from compd.report.small_multiples import SERIES_COLOURS, dot_style, thin
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
        figure.add_vline(moment, line={"dash": "dash", "color": "black"})
        text = change_text(finding, diagnosis)
        figure.add_annotation(x=moment, y=1, yref="paper", yanchor="bottom", text=text, showarrow=False)
    return figure.update_xaxes(title_text="time, h" if recording.has_time else "row", row=len(labels), col=1)


def _places(recording: Recording) -> FloatArray:
    """(N,) hours; rows in a recording without time."""
    return recording.time_s / SECONDS_PER_HOUR if recording.has_time else recording.row.astype(np.float64)


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
