"""Figures of a comparison: its residual in space, at the links, beside the noise floor, and without each source."""

from __future__ import annotations

import numpy as np
from plotly.graph_objects import Bar, Figure, Heatmap, Scatter, Scatter3d
from plotly.subplots import make_subplots

from compd.arrays import FloatArray, rms
from compd.comparison import Comparison
from compd.display_unit import format_error, in_place_unit, place_unit
from compd.report.page import COLOURS, INK, style_figure
from compd.report.page_table import PageTable
from compd.report.small_multiples import NOT_RECORDED, SERIES_COLOURS, add_dots_and_means, thin
from compd.units import UM_PER_MM

# Most arrows; more hide each other.
ARROWS = 400
# Number of the map's cells along each axis.
CELLS = 9
# Thickness of a plane in a scene, as a share of its length.
THIN = 0.01
# Maps: name, and the axes to the right and upwards.
VIEWS = (("from above", 0, 1), ("from the front", 0, 2), ("from the side", 1, 2))
# Length of the typical arrow as a share of the workspace.
ARROW_SHARE = 0.12


def plot_link_residuals(comparison: Comparison) -> Figure | PageTable:
    """The residual as errors of link lengths, against each link's length."""
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
    places_mm, axes = _places_mm(comparison)
    used = np.flatnonzero(comparison.used & np.isfinite(places_mm).all(axis=1))
    if aligned.of_links or len(axes) < 2 or not len(used):
        return NOT_RECORDED, 1.0
    chosen = thin(used, ARROWS)
    tip_mm, unit = places_mm[chosen], aligned.unit
    vector_um = np.zeros((len(chosen), 3))
    vector_um[:, list(aligned.axes)] = _at_tip(comparison)[chosen]
    typical_mm = max(rms(np.linalg.norm(vector_um, axis=1)) / UM_PER_MM, 1e-9)
    reach_mm = float(np.ptp(tip_mm, axis=0).max()) or 1.0
    enlarged = 10.0 ** np.floor(np.log10(ARROW_SHARE * reach_mm / typical_mm))
    enlarged *= max(step for step in (1, 2, 5) if step * enlarged <= ARROW_SHARE * reach_mm / typical_mm)
    end_mm = tip_mm + vector_um / UM_PER_MM * enlarged
    end, gap = in_place_unit(end_mm, unit), np.full_like(tip_mm, np.nan)
    path = np.stack([in_place_unit(tip_mm, unit), end, gap], axis=1).reshape(-1, 3)
    size_um = np.linalg.norm(vector_um, axis=1)
    hover = [
        f"({a:+.3g}, {b:+.3g}, {c:+.3g}) {unit}, row {row}"
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
                "colorbar": {"title": unit, "thickness": 14, "len": 0.8},
            },
        )
    )
    _add_scale_bar(figure, np.nanmin(path, axis=0), axes[0], float(size_um.max()), enlarged, unit)
    style_figure(figure, "", "", 600)
    figure.update_layout(
        scene={
            **{f"{axis}axis_title": f"{axis}, {place_unit(unit)}" for axis in "xyz"},
            **_aspect(np.nanmax(path, axis=0) - np.nanmin(path, axis=0), axes),
        },
        margin={"l": 0, "r": 0, "t": 10, "b": 0},
    )
    return figure, enlarged


def _add_scale_bar(
    figure: Figure, corner: FloatArray, axis: int, longest_um: float, enlarged: float, unit: str
) -> None:
    """A bar of 1, 2 or 5 times a power of ten, at most as long as the longest arrow, from a corner along an axis.

    corner : (3,) in the unit of places.
    """
    if longest_um <= 0:
        return
    power = 10.0 ** np.floor(np.log10(longest_um))
    length_um = max(step * power for step in (1, 2, 5) if step * power <= longest_um)
    end = corner.copy()
    end[axis] += in_place_unit(np.array(length_um / UM_PER_MM * enlarged), unit)
    (x0, y0, z0), (x1, y1, z1) = corner.tolist(), end.tolist()
    figure.add_scatter3d(
        x=[x0, x1],
        y=[y0, y1],
        z=[z0, z1],
        mode="lines+text",
        text=["", f"{length_um:g} {unit}"],
        textposition="top center",
        line={"width": 6, "color": INK},
        hoverinfo="skip",
        showlegend=False,
    )


def plot_histogram(comparison: Comparison) -> Figure:
    """Each coordinate's residual, and the distribution of noise alone."""
    labels, unit = comparison.aligned.labels, comparison.aligned.unit
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
        figure.update_xaxes(title_text=f"residual of {label}, {comparison.aligned.unit_of(label)}", row=1, col=k)
    style_figure(figure, f"residual of {labels[0]}, {unit}", "rows", 350)
    return figure.update_layout(margin={"t": 70}, legend={"y": 1.12})


def plot_workspace_map(comparison: Comparison) -> Figure | PageTable:
    """Rms residual in cells of the workspace: top, front and side views, for the known axes."""
    places_mm, axes = _places_mm(comparison)
    used = comparison.used & np.isfinite(places_mm).all(axis=1)
    views = [(name, a, b) for name, a, b in VIEWS if a in axes and b in axes]
    if not views or not used.any() or np.ptp(places_mm[used], axis=0).max() == 0:
        return NOT_RECORDED
    unit = comparison.aligned.unit
    shown, place = place_unit(unit), in_place_unit(places_mm[used], unit)
    square_um2 = (comparison.residual_um[used] ** 2).mean(axis=1)
    figure = make_subplots(1, len(views), subplot_titles=[name for name, _, _ in views], horizontal_spacing=0.09)
    maps: list[tuple[list[FloatArray], FloatArray]] = []
    for _, a, b in views:
        edges = [np.linspace(*_ends(place[:, axis]), CELLS + 1) for axis in (a, b)]
        total_um2, _, _ = np.histogram2d(place[:, a], place[:, b], bins=edges, weights=square_um2)
        count, _, _ = np.histogram2d(place[:, a], place[:, b], bins=edges)
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
                showscale=k == len(views),
                colorbar={"title": f"{unit} rms", "thickness": 14},
                name=name,
                hovertemplate=f"%{{z:.3g}} {unit} rms<extra></extra>",
            ),
            row=1,
            col=k,
        )
        figure.update_xaxes(title_text=f"{'xyz'[a]}, {shown}", row=1, col=k)
        figure.update_yaxes(title_text=f"{'xyz'[b]}, {shown}", title_standoff=2, row=1, col=k)
    return style_figure(figure, f"x, {shown}", f"y, {shown}", 390).update_layout(margin={"r": 80, "t": 60})


def _aspect(extent: FloatArray, axes: list[int]) -> dict[str, object]:
    """Layout of a scene: axes to scale in an oblique view; a plane in a normal view, its second axis upwards."""
    if len(axes) == 3:
        return {"aspectmode": "data", "camera": {"eye": {"x": 1.3, "y": -1.6, "z": 0.9}}}
    # "data" would give a plane no size: its volume is 0
    ratio = np.where(np.isin(np.arange(3), axes), extent / max(extent.max(), 1e-9), THIN)
    eye = np.where(np.isin(np.arange(3), axes), 0.0, [1.6, -1.6, 1.6])
    return {
        "dragmode": "orbit",  # the default keeps z upwards
        **{f"{axis}axis_visible": k in axes for k, axis in enumerate("xyz")},
        "aspectmode": "manual",
        "aspectratio": dict(zip("xyz", np.maximum(ratio, THIN).tolist(), strict=True)),
        "camera": {"eye": dict(zip("xyz", eye.tolist(), strict=True)), "up": {"xyz"[axes[1]]: 1.0}},
    }


def _at_tip(comparison: Comparison) -> FloatArray:
    """(N, axes) the residual as a vector at the tip, um; of a distance along the line from the fixed ball."""
    aligned, residual_um = comparison.aligned, comparison.residual_um
    if aligned.ends is not None and aligned.ends.of_lengths:
        return np.asarray(aligned.ends.directions(aligned.nominal_tip_mm)[:, 0] * residual_um)
    return residual_um[:, aligned.lengths]


def _places_mm(comparison: Comparison) -> tuple[FloatArray, list[int]]:
    """(N, 3) places of the tip, and the axes that are known; the place is 0 along those that a model does not have."""
    tip_M_mm = comparison.aligned.rows.tip_M_mm
    known = np.isfinite(tip_M_mm).any(axis=0)
    return np.where(known, tip_M_mm, 0.0), np.flatnonzero(known).tolist()


def _ends(values: FloatArray) -> tuple[float, float]:
    low, high = float(values.min()), float(values.max())
    return (low, high) if high > low else (low - 1.0, high + 1.0)


def plot_contributions(comparison: Comparison) -> Figure | PageTable:
    """The error that is left with each source switched off, beside the whole model and the noise floor."""
    if not comparison.contributions:
        return NOT_RECORDED
    unit = comparison.aligned.unit
    names = ["whole model", *(f"without {name}" for name in comparison.contributions)]
    left = [comparison.rms_um, *(part.without_rms_um for part in comparison.contributions.values())]
    colours = [COLOURS["best"], *[COLOURS["plain"]] * (len(names) - 1)]
    figure = Figure(
        Bar(
            x=left,
            y=names,
            orientation="h",
            marker_color=colours,
            text=[format_error(x, unit, 3) for x in left],
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
    style_figure(figure, f"residual, {unit} rms per coordinate", "", 130 + 38 * len(names))
    return figure.update_layout(margin={"l": 210, "r": 90, "t": 40}, xaxis_range=[0, 1.05 * max(left)])
