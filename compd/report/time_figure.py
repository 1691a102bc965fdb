"""The picture of the error over time, with gross rows and with moments at which something changed."""

from __future__ import annotations

import numpy as np
from plotly.graph_objects import Figure, Scatter
from plotly.subplots import make_subplots

from compd.diagnosis.error_fall import ErrorFall
from compd.diagnosis.phrases import change_text, is_change
from compd.diagnosis.verdict import Diagnosis
from compd.report.page import COLOURS, style_figure
from compd.report.small_multiples import SERIES_COLOURS, dot_style, thin
from compd.units import UNIT_KINDS

DOTS = 1500
ROW_PX = 210
# Gross rows beyond so many times the largest row that counts are drawn at the edge.
EDGE = 1.6
SECONDS_PER_HOUR = UNIT_KINDS[1]["h"]


def plot_time(diagnosis: Diagnosis, fall: ErrorFall) -> Figure:
    """The residual with all that was found, over time: rows that count as dots, gross ones as crosses."""
    after = diagnosis.after
    recording, labels = after.aligned.recording, after.aligned.labels
    hours = recording.time_s / SECONDS_PER_HOUR
    gross = np.flatnonzero(np.isin(recording.row, diagnosis.gross.rows))
    figure = make_subplots(len(labels), 1, shared_xaxes=True, vertical_spacing=0.06)
    style_figure(figure, "", "", 110 + ROW_PX * len(labels)).update_layout(margin={"t": 50}, showlegend=False)
    used = np.flatnonzero(after.used)
    dots = thin(used, DOTS)
    for k, label in enumerate(labels):
        values = after.residual_um[:, k]
        edge = EDGE * float(np.abs(values[used]).max())
        place = {"row": k + 1, "col": 1}
        dot = {**dot_style(len(dots)), "color": SERIES_COLOURS[k % len(SERIES_COLOURS)]}
        figure.add_trace(
            Scatter(
                x=hours[dots].astype(np.float32),
                y=values[dots].astype(np.float32),
                mode="markers",
                marker=dot,
                hovertemplate="%{y:.3g} at %{x:.3g} h<extra></extra>",
            ),
            **place,
        )
        shown = np.clip(np.nan_to_num(values[gross], nan=edge), -edge, edge)
        texts = [
            f"row {row}: {value:.4g} {fall.unit}"
            for row, value in zip(recording.row[gross], values[gross], strict=True)
        ]
        cross = {
            "size": 9,
            "color": COLOURS["worst"],
            "symbol": "x-thin",
            "line": {"width": 2, "color": COLOURS["worst"]},
        }
        figure.add_trace(
            Scatter(x=hours[gross], y=shown, mode="markers", marker=cross, text=texts, hoverinfo="text"), **place
        )
        figure.update_yaxes(title_text=f"error in {label}, {fall.unit}", range=[-1.08 * edge, 1.08 * edge], **place)
    for finding in diagnosis.depends_on:
        if is_change(finding):
            moment_h = finding.time_s / SECONDS_PER_HOUR
            figure.add_vline(moment_h, line={"dash": "dash", "color": "black"})
            text = change_text(finding, diagnosis)
            figure.add_annotation(x=moment_h, y=1, yref="paper", yanchor="bottom", text=text, showarrow=False)
    return figure.update_xaxes(title_text="time, h", row=len(labels), col=1)
