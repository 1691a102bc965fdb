"""Small multiples: values of a comparison's rows against each covariate, as dots and class means."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from plotly.graph_objects import Figure, Scatter
from plotly.subplots import make_subplots

from compd.arrays import FloatArray, IntArray
from compd.comparison import Comparison, Covariate
from compd.report.axis_colours import AXIS_COLOURS
from compd.report.page import COLOURS, style_figure
from compd.report.page_table import PageTable

# Most dots; more hide each other. Means are always over all rows.
DOTS = 500
FEW_DOTS = 200
BINS = 12
COLUMNS = 3
# Of coordinates, the first three x, y and z.
SERIES_COLOURS = (*AXIS_COLOURS.values(), COLOURS["middle"], "#cc79a7", "#56b4e9")
NOT_RECORDED = PageTable(("",), [("not recorded, or it never changed",)])


def plot_residual_against(comparison: Comparison, columns: Sequence[Covariate]) -> Figure | PageTable:
    """The residual against each covariate: dots, and each coordinate's mean in twelve classes of equally many rows."""
    label = f"residual, {comparison.aligned.unit}"
    return small_multiples(comparison, columns, comparison.residual_um, comparison.aligned.labels, label)


def small_multiples(
    comparison: Comparison, columns: Sequence[Covariate], values_um: FloatArray, names: Sequence[str], label: str
) -> Figure | PageTable:
    """One small figure per covariate, side by side with a common scale; NOT_RECORDED where no covariate changes.

    values_um : (N, series), named `names`, over the rows of the comparison.  label : of the vertical axes.
    """
    used = np.flatnonzero(comparison.used)
    changing = [column for column in columns if _changes(column.values[used])]
    if not changing:
        return NOT_RECORDED
    lines = -(-len(changing) // COLUMNS)
    across = min(COLUMNS, len(changing))
    figure = make_subplots(
        lines,
        across,
        shared_yaxes=True,
        # a difference of two has a long name, which would reach into the next figure
        subplot_titles=[covariate.name.replace(" - ", "<br>- ") for covariate in changing],
        vertical_spacing=min(0.45 / lines, 0.3),
        horizontal_spacing=0.04,
    )
    style_figure(figure, "", "", 80 + 240 * lines).update_layout(
        legend={"y": 1 + 45 / (240 * lines), "itemsizing": "constant"}, margin={"t": 70}
    ).update_annotations(font_size=14)
    for k, covariate in enumerate(changing):
        row, col = k // across + 1, k % across + 1
        for series, name in enumerate(names):
            colour = SERIES_COLOURS[series % len(SERIES_COLOURS)]
            add_dots_and_means(
                figure,
                (row, col),
                covariate.values,
                values_um[:, series],
                used,
                name,
                colour,
                legend=k == 0,
                unit=comparison.aligned.unit,
            )
        figure.update_xaxes(title_text=axis_unit(covariate), title_standoff=4, row=row, col=col)
        if col == 1:
            figure.update_yaxes(title_text=label, row=row, col=1)
    return figure


def _changes(values: FloatArray) -> bool:
    return bool(np.isfinite(values).any() and np.nanstd(values) > 0)


def axis_unit(covariate: Covariate) -> str:
    """The unit of the covariate itself, where `Covariate.unit` is that of its changes; of a link's direction, words."""
    if covariate.name.startswith("temperature"):
        return "K" if " - " in covariate.name else "degC"
    if covariate.name.startswith("direction of link"):
        return "-1 = shortening, +1 = lengthening"
    if covariate.name.startswith("direction of axis"):
        return "-1 = backwards, +1 = forwards"
    return "" if covariate.unit == "1" else covariate.unit


def axis_title(covariate: Covariate) -> str:
    """Name and unit of a covariate, for an axis that has no other heading."""
    if covariate.name.startswith("direction of "):
        return covariate.name
    unit = axis_unit(covariate)
    return f"{covariate.name}, {unit}" if unit else covariate.name


def add_dots_and_means(
    figure: Figure,
    place: tuple[int, int],
    x: FloatArray,
    y_um: FloatArray,
    rows: IntArray,
    name: str,
    colour: str,
    legend: bool,
    unit: str = "um",
) -> None:
    """Add values y_um (N,) against x (N,) to the subplot at `place` (row, column): dots, and means of classes.

    rows : (R,) indices of the rows that count.  legend : whether the series gets an entry.  unit : in place of um.
    """
    known = rows[np.isfinite(x[rows]) & np.isfinite(y_um[rows])]
    dots = thin(known, DOTS)
    row, col = place
    figure.add_trace(
        Scatter(
            # seven digits are more than a picture shows, and halve the page's size
            x=x[dots].astype(np.float32),
            y=y_um[dots].astype(np.float32),
            mode="markers",
            showlegend=False,
            legendgroup=name,
            marker={**dot_style(len(dots)), "color": colour},
            hovertemplate=f"{name}: %{{y:.3g}} {unit} at %{{x:.4g}}<extra></extra>",
        ),
        row=row,
        col=col,
    )
    middle, mean, _ = class_means(x[known], y_um[known])
    figure.add_trace(
        Scatter(
            x=middle,
            y=mean,
            mode="lines+markers",
            name=name,
            legendgroup=name,
            showlegend=legend,
            line={"color": colour, "width": 2},
            marker={"size": 5, "color": colour},
            hovertemplate=f"{name}, mean: %{{y:.3g}} {unit}<extra></extra>",
        ),
        row=row,
        col=col,
    )


def dot_style(count: int) -> dict[str, float]:
    """Size and opacity of dots by their number: few stay visible, many do not hide each other."""
    return {"size": 3, "opacity": 0.35} if count > FEW_DOTS else {"size": 5, "opacity": 0.6}


def class_means(x: FloatArray, y: FloatArray, classes: int = BINS) -> tuple[FloatArray, FloatArray, IntArray]:
    """(C,) means of x and of y (R,) in classes of about equally many rows, and these; equal values are never split."""
    ends = np.unique(np.quantile(x, np.linspace(0, 1, classes + 1)[1:]))
    group = np.searchsorted(ends, x)
    count = np.bincount(group)
    filled = count > 0
    return np.bincount(group, x)[filled] / count[filled], np.bincount(group, y)[filled] / count[filled], count[filled]


def thin(rows: IntArray, most: int) -> IntArray:
    """An even selection of the rows, up to a number."""
    return rows[np.linspace(0, len(rows) - 1, min(most, len(rows))).astype(np.int64)]
