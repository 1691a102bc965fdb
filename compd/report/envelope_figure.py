"""The residual of a long recording over time: a band from the smallest to the largest value, and the mean."""

from __future__ import annotations

import numpy as np
from plotly.graph_objects import Figure, Scatter
from plotly.subplots import make_subplots

from compd.comparison import StreamedComparison
from compd.report.page import style_figure
from compd.report.small_multiples import SERIES_COLOURS
from compd.units import UNIT_KINDS

ROW_PX = 210
SECONDS_PER_HOUR = UNIT_KINDS[1]["h"]


def plot_envelope(comparison: StreamedComparison) -> Figure:
    """All used rows, one coordinate below the other."""
    aligned, envelope = comparison.aligned, comparison.totals.envelope
    figure = make_subplots(len(aligned.labels), 1, shared_xaxes=True, vertical_spacing=0.06)
    style_figure(figure, "", "", 110 + ROW_PX * len(aligned.labels)).update_layout(showlegend=False)
    has_time = aligned.recording.has_time
    x = (envelope.middle_s / SECONDS_PER_HOUR if has_time else envelope.middle_s).astype(np.float32)
    for k, label in enumerate(aligned.labels):
        colour = SERIES_COLOURS[k % len(SERIES_COLOURS)]
        # the largest first, and the smallest filled up to it
        for values, line, fill in (
            (envelope.largest, {"width": 0.5, "color": colour}, None),
            (envelope.smallest, {"width": 0.5, "color": colour}, "tonexty"),
            (envelope.mean, {"width": 1.5, "color": "black"}, None),
        ):
            trace = Scatter(x=x, y=values[:, k].astype(np.float32), mode="lines", line=line, fill=fill)
            figure.add_trace(trace, row=k + 1, col=1)
        figure.update_yaxes(title_text=f"residual in {label}, {aligned.unit_of(label)}", row=k + 1, col=1)
    return figure.update_xaxes(title_text="time, h" if has_time else "row", row=len(aligned.labels), col=1)
