"""The picture of one effect: the error against its driver, before and after, side by side on one scale."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from plotly.graph_objects import Box, Figure, Scatter
from plotly.subplots import make_subplots

from compd.arrays import FloatArray, IntArray
from compd.comparison import Comparison
from compd.diagnosis import ErrorFall
from compd.model.effects import FittedEffect
from compd.report.driver import Driver, find_driver
from compd.report.error_part import ErrorContribution, error_contribution
from compd.report.page import INK, style_figure
from compd.report.small_multiples import DOTS, SERIES_COLOURS, add_dots_and_means, class_means, dot_style, thin

# Most drawn series, those with the largest effect.
MAX_SERIES = 3
# Most different values of a driver that is drawn as boxes.
MAX_BOXES = 6
# Points of a fitted curve.
CURVE_CLASSES = 60
ROW_PX = 250
# Share of the rows on either side outside the vertical scale; a few stray dots would flatten the rest.
STRAY = 0.002
HOW_TO_READ = (
    "Left: the error with everything but this. Right: with this too, on the same scale; nothing should follow the "
    "driver any more. Dots are rows, coloured lines their means"
)


def plot_step(
    comparison: Comparison, effects: Sequence[FittedEffect], fall: ErrorFall, described: Sequence[FittedEffect] = ()
) -> tuple[Figure, str]:
    """The picture of the effects together, and how to read it.

    comparison, described : as in `error_contribution`.
    """
    part = error_contribution(comparison, effects, described)
    shown = part.largest(MAX_SERIES)
    drivers = [find_driver(part, k, effects, comparison.aligned, fall.unit) for k in shown]
    figure = make_subplots(
        len(shown),
        2,
        shared_yaxes=True,
        column_titles=["before", "after"],
        horizontal_spacing=0.04,
        vertical_spacing=min(0.35 / len(shown), 0.3),
    )
    style_figure(figure, "", "", 90 + ROW_PX * len(shown)).update_layout(margin={"t": 50}, showlegend=False)
    for row, (k, driver) in enumerate(zip(shown, drivers, strict=True), start=1):
        _add_series(figure, row, part, k, driver, fall)
        figure.update_yaxes(title_text=f"error of {part.series[k]}, {fall.unit}", row=row, col=1)
    curves = any(driver.one_line and not _is_discrete(driver, part) for driver in drivers)
    caption = HOW_TO_READ + (", the line in black or white is what it does with its fitted numbers" if curves else "")
    if fall.noise_known:
        caption += "; the grey band is the noise, one standard deviation either way"
    if len(shown) < len(part.series):
        caption += f". Drawn where it does most: {', '.join(part.series[k] for k in shown)}"
    return figure, f"{caption}."


def _add_series(figure: Figure, row: int, part: ErrorContribution, k: int, driver: Driver, fall: ErrorFall) -> None:
    """One series before and after."""
    used = np.flatnonzero(part.used & np.isfinite(driver.values))
    colour = SERIES_COLOURS[k % len(SERIES_COLOURS)]
    discrete = _is_discrete(driver, part)
    for col, values in ((1, part.before[:, k]), (2, part.after[:, k])):
        if discrete:
            _add_boxes(figure, (row, col), driver, values, used, colour)
        else:
            add_dots_and_means(
                figure, (row, col), driver.values, values, used, part.series[k], colour, legend=False, unit=fall.unit
            )
            figure.update_xaxes(title_text=driver.title, title_standoff=4, row=row, col=col)
        if fall.noise_known:
            figure.add_hrect(-fall.noise, fall.noise, fillcolor="#8a8f98", opacity=0.18, line_width=0, row=row, col=col)
    if driver.one_line and not discrete:
        x, y, _ = class_means(driver.values[used], part.part[used, k], min(CURVE_CLASSES, len(used)))
        line = {"color": INK, "width": 1.5}
        figure.add_trace(Scatter(x=x, y=y, mode="lines", line=line, hoverinfo="skip"), row=row, col=1)
    figure.update_yaxes(range=_span(part.before[used, k], fall), row=row)


def _add_boxes(
    figure: Figure, place: tuple[int, int], driver: Driver, values: FloatArray, used: IntArray, colour: str
) -> None:
    """A box with its rows beside it for each value of the driver."""
    row, col = place
    names = {-1.0: driver.ends[0], 1.0: driver.ends[1]} if driver.ends else {}
    for value in np.unique(driver.values[used]):
        rows = used[driver.values[used] == value]
        figure.add_trace(
            Box(
                y=values[thin(rows, DOTS)].astype(np.float32),
                name=names.get(float(value), f"{value:g}"),
                boxpoints="all",
                jitter=0.6,
                pointpos=0,
                marker={**dot_style(len(rows)), "color": colour},
                line={"color": colour, "width": 2},
                fillcolor="rgba(0,0,0,0)",
                hovertemplate="%{y:.3g}<extra></extra>",
            ),
            row=row,
            col=col,
        )
    figure.update_xaxes(title_text=driver.title, title_standoff=4, type="category", row=row, col=col)


def _is_discrete(driver: Driver, part: ErrorContribution) -> bool:
    values = driver.values[part.used]
    return len(np.unique(values[np.isfinite(values)])) <= MAX_BOXES


def _span(before: FloatArray, fall: ErrorFall) -> list[float]:
    """The common vertical scale: that of the error before."""
    low, high = np.quantile(before, [STRAY, 1 - STRAY])
    noise = 2.5 * fall.noise if fall.noise_known else 0.0
    low, high = min(low, -noise), max(high, noise)
    margin = 0.06 * (high - low) or 1.0
    return [float(low - margin), float(high + margin)]
