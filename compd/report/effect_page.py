"""The picture of an effect's signature: arrows over the workspace, curves against what drives it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from plotly.graph_objects import Cone, Figure, Scatter, Scatter3d

from compd.configuration import Configuration
from compd.machine_builder import build_model, machine_details
from compd.model.effects import Constant, Effect, Parameter
from compd.report.axis_colours import AXIS_COLOURS
from compd.report.effect_signature import (
    ASIDE_MM,
    FORCE_N,
    GRADIENT_K,
    SPEED_MM_PER_S,
    WARMING_K,
    Curve,
    Signature,
    compute_signature,
)
from compd.report.page import COLOURS, Panel, style_figure, write_page
from compd.report.page_table import PageTable


def write_effect_page(path: Path, effect: Effect, configuration: Configuration) -> None:
    """Write the page. Raises CompdError if the machine lacks a setting that the effect needs."""
    model = build_model(configuration.geometry, configuration.wiring)
    result = compute_signature(effect, model, machine_details(configuration.geometry))
    largest_um = float(np.linalg.norm(result.tip_um, axis=1).max())
    numbers = ", ".join(f"{name} = {value}" for name, value in result.parameters.items())
    verdict = (
        f"{effect.physics} With {numbers} it moves the tip of {configuration.machine} by up to {largest_um:.3g} um."
    )
    driven = (
        f"Every thermometer shows {WARMING_K:g} K above 20 degC, the plate is {GRADIENT_K:g} K warmer on top, "
        f"a force of {FORCE_N:g} N presses down and another one along x, every link grows at {SPEED_MM_PER_S:g} mm/s."
    )
    panels = [
        Panel("Over the workspace", f"Arrows: the tip's error, drawn large. {driven}", _plot_arrows(result)),
        *(Panel(f"Against {curve.label}", _place_text(curve), _plot_curve(curve)) for curve in result.curves),
        Panel("The effect", "As the library declares it.", _declaration(effect)),
    ]
    write_page(path, f"{effect.id} on {configuration.machine}", verdict, panels, f"source: {effect.source}")


def _place_text(curve: Curve) -> str:
    if "machine zero" in curve.label:
        return "Error of the tip along a line through machine zero."
    x, y, _ = ASIDE_MM
    return f"Error of the tip at a place {x:g} mm in x and {y:g} mm in y from machine zero."


def _plot_arrows(result: Signature) -> Figure:
    """The tip's error over the workspace, as cones at the places and in the direction of the error."""
    x, y, z = result.tip_mm.T
    u, v, w = result.tip_um.T
    size_um = np.linalg.norm(result.tip_um, axis=1)
    hover = [f"({a:.1f}, {b:.1f}, {c:.1f}) um, {s:.2f} um" for (a, b, c), s in zip(result.tip_um, size_um, strict=True)]
    figure = Figure()
    figure.add_trace(
        Scatter3d(
            x=x,
            y=y,
            z=z,
            mode="markers",
            marker={"size": 2, "color": COLOURS["quiet"]},
            showlegend=False,
            hoverinfo="skip",
        )
    )
    figure.add_trace(
        Cone(
            x=x,
            y=y,
            z=z,
            u=u,
            v=v,
            w=w,
            text=hover,
            hoverinfo="text",
            anchor="tail",
            sizemode="scaled",
            sizeref=1.2,
            colorscale="Viridis",
            colorbar={"title": "um"},
        )
    )
    style_figure(figure, "", "", 560)
    figure.update_layout(scene={f"{axis}axis_title": f"{axis} in {{M}}, mm" for axis in "xyz"} | {"aspectmode": "data"})
    return figure


def _plot_curve(curve: Curve) -> Figure:
    """The tip's error in x, y and z over what drives it."""
    figure = Figure()
    for axis, values in zip("xyz", curve.tip_um.T, strict=True):
        figure.add_trace(Scatter(x=curve.driven_by, y=values, name=axis, line={"color": AXIS_COLOURS[axis]}))
    return style_figure(figure, curve.label, "error of the tip, um")


def _declaration(effect: Effect) -> PageTable:
    """The effect as the library declares it."""
    rows = [["equation", effect.equation], *([symbol, meaning] for symbol, meaning in effect.symbols.items())]
    numbers: list[Parameter | Constant] = [*effect.parameters, *effect.constants]
    rows += [
        [f"{number.name}, {number.unit}", f"plausible {number.low:g} to {number.high:g}: {number.source}"]
        for number in numbers
    ]
    rows += [["mistaken for", ", ".join(effect.mistaken_for) or "-"], ["separated by", effect.separated_by]]
    return PageTable(["", effect.id], rows)
