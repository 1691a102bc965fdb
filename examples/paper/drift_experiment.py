"""Figure 21: a reference ball on the surface plate does not move; its measured coordinates do, as the machine warms."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from plotly.graph_objects import Figure

from compd.arrays import FloatArray
from compd.configuration import Configuration
from compd.report import COLOURS, Panel, style_figure
from compd.simulation import TRACKER, World
from compd.units import UM_PER_MM
from gauge_log import GaugeLog, probe_ball
from reproduction import Reduction, Reproduction

HOUR_S = 3600.0
EVERY_S = 600.0
HOURS = 10.0
KIND_COLOURS = {"without compensation": "worst", "with compensation": "best"}


@dataclass(frozen=True)
class DriftResult:
    """time_h, frame_degC : (N,). change_um : by kind, (N, 3) change of the ball's measured place since the first."""

    time_h: FloatArray
    change_um: dict[str, FloatArray]
    frame_degC: FloatArray


def run(configuration: Configuration, seed: int) -> DriftResult:
    """Measure the ball every ten minutes for ten hours after switch-on; the machine tours its points in between."""
    world = World(configuration.geometry, configuration.wiring, seed)
    rng = np.random.default_rng([seed, 21])
    machine = world.mechanism
    ball = machine.tip0_M if machine.tip_frame == "M" else machine.tip0_P
    gauge_log, time_h, frame_degC = GaugeLog(), [], []
    for _ in range(int(HOURS * HOUR_S / EVERY_S) + 1):
        probe_ball(world, TRACKER.measure(ball, rng))
        gauge_log.read(world)
        time_h.append(world.time_s / HOUR_S)
        frame_degC.append(world.sense("temperature_frame_degC"))
        world.start_tour()
        world.advance(EVERY_S)
    change_um = {}
    for kind, compensated in zip(KIND_COLOURS, (False, True), strict=True):
        places = gauge_log.tips_mm(configuration, joints=compensated, frame=compensated)
        change_um[kind] = (places - places[0]) * UM_PER_MM
    return DriftResult(np.array(time_h), change_um, np.array(frame_degC))


def reproduce(configuration: Configuration, seed: int) -> Reproduction:
    """Run and evaluate the experiment on this machine; seed : of joints, weather and noise."""
    result = run(configuration, seed)
    return Reproduction("Figure 21: a ball on the surface plate during warm-up", reductions(result), panels(result))


def reductions(result: DriftResult) -> list[Reduction]:
    """Peak-to-peak change of each coordinate, z first; figure 21 states no numbers."""
    without, full = result.change_um.values()
    stated = ("change of x", "change of y", "change of z")
    paper = ("x and y: so small because the frame is axisymmetric", "x and y: so small", "decreases; no number")
    return [
        Reduction(
            f"{stated[axis]}, peak to peak", float(np.ptp(without[:, axis])), float(np.ptp(full[:, axis])), paper[axis]
        )
        for axis in (2, 0, 1)
    ]


def panels(result: DriftResult) -> list[Panel]:
    """Change of z, of x and y, and the frame's temperature by time, as in figure 21."""

    def change(axes: str) -> Figure:
        figure = Figure()
        for kind, change_um in result.change_um.items():
            for axis in axes:
                dash = {"x": "dot", "y": "dash", "z": "solid"}[axis]
                figure.add_scatter(
                    x=result.time_h,
                    y=change_um[:, "xyz".index(axis)],
                    mode="lines+markers",
                    name=kind if axes == "z" else f"{axis}, {kind}",
                    marker={"size": 4},
                    line={"color": COLOURS[KIND_COLOURS[kind]], "dash": dash},
                )
        return style_figure(figure, "time since switch-on, h", f"change of {' and '.join(axes)}, um", 380)

    warm = Figure()
    warm.add_scatter(x=result.time_h, y=result.frame_degC, mode="lines", line={"color": COLOURS["plain"]})
    return [
        Panel("Z of the ball", "The ball stands still on the surface plate; what changes is the machine.", change("z")),
        Panel(
            "X and Y of the ball",
            "An axisymmetric frame would leave both at zero; here a cabinet stands beside one column.",
            change("xy"),
        ),
        Panel(
            "Temperature of the frame",
            "Mean of the columns.",
            style_figure(warm, "time since switch-on, h", "degC", 240),
        ),
    ]
