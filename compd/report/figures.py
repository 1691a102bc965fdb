"""Figures of a comparison: its residual in space, at the links, beside the noise floor, and without each source."""

from __future__ import annotations

import numpy as np
from plotly.graph_objects import Bar, Figure, Heatmap, Scatter, Scatter3d
from plotly.subplots import make_subplots

from compd.arrays import FloatArray, rms
from compd.comparison.compare import Comparison
from compd.report.page import COLOURS, style_figure
from compd.report.page_table import PageTable
from compd.report.small_multiples import NOT_RECORDED, SERIES_COLOURS, add_dots_and_means, thin
from compd.units import UM_PER_MM

# More arrows than this hide each other.
ARROWS = 400
# Cells of the map along each axis.
CELLS = 9
# The typical arrow is drawn as long as this share of the workspace.
ARROW_SHARE = 0.12


def plot_link_residuals(comparison: Comparison) -> Figure | PageTable:
    """The residual as errors of the links' lengths, against each link's own length."""
    links_um = comparison.link_residual_um
    if links_um is None:
        return NOT_RECORDED
    count = links_um.shape[1]
    figure = make_subplots(1, count, shared_yaxes=True, subplot_titles=[f"link {i + 1}" for i in range(count)])
    rows = np.flatnonzero(comparison.used)
    for i in range(count):
        length_mm = comparison.aligned.rows.link_mm[:, i]
        add_dots_and_means(
            figure, (1, i + 1), length_mm, links_um[:, i], rows, f"link {i + 1}", SERIES_COLOURS[i], False
        )
        figure.update_xaxes(title_text="length, mm", row=1, col=i + 1)
    return style_figure(figure, "length, mm", "error of length, um", 340).update_layout(margin={"t": 60})


def plot_residual_vectors(comparison: Comparison) -> tuple[Figure | PageTable, float]:
    """Residual vectors in the workspace, and how many times they are enlarged."""
    aligned = comparison.aligned
    used = np.flatnonzero(comparison.used & np.isfinite(aligned.rows.tip_M_mm).all(axis=1))
    if aligned.of_links or not len(used):
        return NOT_RECORDED, 1.0
    chosen = thin(used, ARROWS)
    tip = aligned.rows.tip_M_mm[chosen]
    vector_um = np.zeros((len(chosen), 3))
    vector_um[:, list(aligned.axes)] = comparison.residual_um[chosen]
    typical_mm = max(rms(np.linalg.norm(vector_um, axis=1)) / UM_PER_MM, 1e-9)
    reach_mm = float(np.ptp(tip, axis=0).max()) or 1.0
    enlarged = 10.0 ** np.floor(np.log10(ARROW_SHARE * reach_mm / typical_mm))
    enlarged *= max(step for step in (1, 2, 5) if step * enlarged <= ARROW_SHARE * reach_mm / typical_mm)
    end = tip + vector_um / UM_PER_MM * enlarged
    gap = np.full_like(tip, np.nan)
    path = np.stack([tip, end, gap], axis=1).reshape(-1, 3)
    size_um = np.linalg.norm(vector_um, axis=1)
    hover = [
        f"({a:+.2f}, {b:+.2f}, {c:+.2f}) um, row {row}"
        for (a, b, c), row in zip(vector_um, aligned.recording.row[chosen], strict=True)
    ]
    figure = Figure()
    figure.add_trace(
        Scatter3d(
            x=path[:, 0],
            y=path[:, 1],
            z=path[:, 2],
            mode="lines",
            showlegend=False,
            line={"width": 4, "color": np.repeat(size_um, 3), "colorscale": "Viridis"},
            hoverinfo="skip",
        )
    )
    figure.add_trace(
        Scatter3d(
            x=end[:, 0],
            y=end[:, 1],
            z=end[:, 2],
            mode="markers",
            showlegend=False,
            text=hover,
            hoverinfo="text",
            marker={
                "size": 3,
                "color": size_um,
                "colorscale": "Viridis",
                "colorbar": {"title": "um", "thickness": 14, "len": 0.8},
            },
        )
    )
    style_figure(figure, "", "", 600)
    figure.update_layout(
        scene={
            **{f"{axis}axis_title": f"{axis}, mm" for axis in "xyz"},
            "aspectmode": "data",
            "camera": {"eye": {"x": 1.3, "y": -1.6, "z": 0.9}},
        },
        margin={"l": 0, "r": 0, "t": 10, "b": 0},
    )
    return figure, enlarged


def plot_histogram(comparison: Comparison) -> Figure:
    """Each coordinate's residual, and what noise alone would make."""
    labels = comparison.aligned.labels
    figure = make_subplots(1, len(labels), subplot_titles=list(labels))
    for k, label in enumerate(labels, start=1):
        values = comparison.residual_um[comparison.used, k - 1]
        sigma = float(comparison.floor.by_axis_um[k - 1])
        edge = max(float(np.abs(values).max()), 4 * sigma)
        edges = np.linspace(-edge, edge, 61)
        count, _ = np.histogram(values, edges)
        width = edges[1] - edges[0]
        middle = (edges[1:] + edges[:-1]) / 2
        figure.add_trace(
            Bar(
                x=middle,
                y=count,
                width=width,
                marker={"color": COLOURS["plain"], "opacity": 0.6},
                name="residual",
                showlegend=k == 1,
            ),
            row=1,
            col=k,
        )
        grid = np.linspace(-edge, edge, 400)
        height = len(values) * width / (sigma * np.sqrt(2 * np.pi)) if sigma > 0 else 0.0
        noise = height * np.exp(-0.5 * (grid / max(sigma, 1e-12)) ** 2)
        figure.add_trace(
            Scatter(
                x=grid,
                y=noise,
                mode="lines",
                line={"color": COLOURS["worst"], "width": 2},
                name="noise alone",
                showlegend=k == 1,
            ),
            row=1,
            col=k,
        )
        figure.update_xaxes(title_text=f"residual of {label}, um", row=1, col=k)
    style_figure(figure, f"residual of {labels[0]}, um", "rows", 350)
    return figure.update_layout(margin={"t": 70}, legend={"y": 1.12})


def plot_workspace_map(comparison: Comparison) -> Figure | PageTable:
    """Rms residual in cells of the workspace, seen from above, from the front and from the side."""
    aligned = comparison.aligned
    used = comparison.used & np.isfinite(aligned.rows.tip_M_mm).all(axis=1)
    if not used.any():
        return NOT_RECORDED
    tip_mm = aligned.rows.tip_M_mm[used]
    square_um2 = (comparison.residual_um[used] ** 2).mean(axis=1)
    views = [("from above", 0, 1), ("from the front", 0, 2), ("from the side", 1, 2)]
    figure = make_subplots(1, 3, subplot_titles=[name for name, _, _ in views], horizontal_spacing=0.09)
    maps: list[tuple[list[FloatArray], FloatArray]] = []
    for _, a, b in views:
        edges = [np.linspace(*_ends(tip_mm[:, axis]), CELLS + 1) for axis in (a, b)]
        total_um2, _, _ = np.histogram2d(tip_mm[:, a], tip_mm[:, b], bins=edges, weights=square_um2)
        count, _, _ = np.histogram2d(tip_mm[:, a], tip_mm[:, b], bins=edges)
        with np.errstate(invalid="ignore"):
            maps.append((edges, np.sqrt(total_um2 / np.where(count > 0, count, np.nan))))
    highest_um = max(float(np.nanmax(cells_um)) for _, cells_um in maps)
    for k, ((name, a, b), (edges, cells_um)) in enumerate(zip(views, maps, strict=True), start=1):
        middle = [(edge[1:] + edge[:-1]) / 2 for edge in edges]
        figure.add_trace(
            Heatmap(
                x=middle[0],
                y=middle[1],
                z=cells_um.T,
                zmin=0.0,
                zmax=highest_um,
                colorscale="Viridis",
                showscale=k == 3,
                colorbar={"title": "um rms", "thickness": 14},
                name=name,
                hovertemplate="%{z:.2f} um rms<extra></extra>",
            ),
            row=1,
            col=k,
        )
        figure.update_xaxes(title_text=f"{'xyz'[a]}, mm", row=1, col=k)
        figure.update_yaxes(title_text=f"{'xyz'[b]}, mm", title_standoff=2, row=1, col=k)
    return style_figure(figure, "x, mm", "y, mm", 390).update_layout(margin={"r": 80, "t": 60})


def _ends(values: FloatArray) -> tuple[float, float]:
    low, high = float(values.min()), float(values.max())
    return (low, high) if high > low else (low - 1.0, high + 1.0)


def plot_contributions(comparison: Comparison) -> Figure | PageTable:
    """The error that is left with each source switched off, beside the whole model and the noise floor."""
    if not comparison.contributions:
        return NOT_RECORDED
    names = ["whole model", *(f"without {name}" for name in comparison.contributions)]
    left = [comparison.rms_um, *(part.without_rms_um for part in comparison.contributions.values())]
    colours = [COLOURS["best"], *[COLOURS["plain"]] * (len(names) - 1)]
    figure = Figure(
        Bar(
            x=left,
            y=names,
            orientation="h",
            marker_color=colours,
            text=[f"{x:.3g} um" for x in left],
            textposition="outside",
            cliponaxis=False,
            showlegend=False,
        )
    )
    figure.add_vline(
        comparison.floor.um,
        line={"color": COLOURS["worst"], "dash": "dash"},
        annotation_text="noise floor",
        annotation_position="top",
    )
    figure.update_yaxes(autorange="reversed")
    style_figure(figure, "residual, um rms per coordinate", "", 130 + 38 * len(names))
    return figure.update_layout(margin={"l": 210, "r": 90, "t": 40}, xaxis_range=[0, 1.05 * max(left)])
