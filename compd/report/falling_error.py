"""The picture of the falling error: from the initial error, with each effect, down to the noise."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import NamedTuple

from plotly.graph_objects import Bar, Figure, Scatter

from compd.diagnosis import Diagnosis, ErrorFall, Holdout, short_name
from compd.report.page import COLOURS, style_figure
from compd.text import number_text

# Most letters of a name on one line beside its bar.
NAME_WIDTH = 30
LINE_PX, ROW_PX = 18, 44
# Start of the axis as a share of the smallest number (room for its label), and its end as a multiple of the largest.
LEFT, RIGHT = 0.4, 1.4
CAPTION = (
    "Error per coordinate, rms; with an effect or a description, on rows that were left out when its numbers were "
    "fitted. The scale is logarithmic: equal lengths are equal factors, so that small ends can be read."
)


class _Fall(NamedTuple):
    """One bar from an error down to another; nan without a previous error."""

    name: str
    before: float
    after: float
    colour: str


def plot_falling_error(diagnosis: Diagnosis, holdouts: Sequence[Holdout], fall: ErrorFall) -> Figure:
    """One bar for each effect, from the error without it to the error with it; the noise is a band from the left."""
    falls = _falls(diagnosis, holdouts, fall)
    names = [_wrapped(bar.name) for bar in falls]
    known = [value for bar in falls for value in (bar.before, bar.after) if math.isfinite(value) and value > 0]
    noise = [fall.noise] if fall.noise_known and fall.noise > 0 else []
    low, high = LEFT * min([*known, *noise], default=1.0), RIGHT * max([*known, *noise], default=1.0)
    figure = Figure()
    figure.add_trace(
        Bar(
            y=names,
            base=[bar.after for bar in falls],
            x=[bar.before - bar.after if math.isfinite(bar.before) else 0.0 for bar in falls],
            orientation="h",
            width=0.5,
            marker={"color": [bar.colour for bar in falls], "opacity": 0.45},
            hoverinfo="skip",
        )
    )
    figure.add_trace(
        Scatter(
            x=[bar.after for bar in falls],
            y=names,
            mode="markers+text",
            marker={"color": [bar.colour for bar in falls], "size": 12},
            text=[f"<b>{number_text(bar.after, fall.unit)}</b>  " for bar in falls],
            textposition="middle left",
            cliponaxis=False,
            hovertemplate="%{y}: %{x:.4g}<extra></extra>",
        )
    )
    if noise:
        figure.add_vrect(low, fall.noise, fillcolor=COLOURS["quiet"], opacity=0.22, line_width=0, layer="below")
        label = {"yref": "paper", "y": 1.0, "yanchor": "bottom", "showarrow": False}
        text = f"noise: {number_text(fall.noise, fall.unit)}"
        figure.add_annotation(x=math.log10(fall.noise), text=text, xanchor="right", **label)
    lines = sum(max(ROW_PX, LINE_PX * (name.count("<br>") + 1) + 12) for name in names)
    style_figure(figure, f"error, {fall.unit}", "", 110 + lines)
    figure.update_xaxes(type="log", range=[math.log10(low), math.log10(high)], dtick="D2", tickformat=".2~r")
    figure.update_yaxes(autorange="reversed", automargin=True, ticklabelstandoff=8)
    return figure.update_layout(showlegend=False, margin={"t": 40, "r": 30, "l": 20})


def _falls(diagnosis: Diagnosis, holdouts: Sequence[Holdout], fall: ErrorFall) -> list[_Fall]:
    falls = [_Fall("as it was", math.nan, fall.before, COLOURS["worst"])]
    errors = [fall.before, *fall.steps]
    for number, step in enumerate(diagnosis.steps):
        last = number == len(diagnosis.steps) - 1
        colour = COLOURS["best" if last else "middle"]
        word = "with" if number == 0 else "and"
        falls.append(_Fall(f"{word} {step.effect.id}", errors[number], errors[number + 1], colour))
    if diagnosis.depends_on:
        first = diagnosis.depends_on[0]
        name = f"described by {short_name(first)}"
        falls.append(_Fall(name, fall.after, first.heldout_rms_um, COLOURS["quiet"]))
    for holdout in holdouts:
        name = holdout.after.aligned.recording.path.name
        if diagnosis.steps:
            falls.append(_Fall(f"{name}, sealed", holdout.before.rms_um, holdout.after.rms_um, COLOURS["plain"]))
        else:
            falls.append(_Fall(f"{name}, sealed", math.nan, holdout.before.rms_um, COLOURS["plain"]))
    return falls


def _wrapped(name: str) -> str:
    """A name on several lines, broken at spaces and behind underscores."""
    lines = [""]
    for piece in re.findall(r"[^ _]+[ _]*", name):
        if lines[-1] and len(lines[-1]) + len(piece.rstrip()) > NAME_WIDTH:
            lines.append("")
        lines[-1] += piece
    return "<br>".join(line.rstrip(" ") for line in lines)
