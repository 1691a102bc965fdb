"""Figure 20: the balls of a 3D ball plate are measured, the distances between them compared with its certificate."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from plotly.graph_objects import Figure

from compd.arrays import FloatArray, rms
from compd.configuration import Configuration
from compd.report import COLOURS, Panel, style_figure
from compd.simulation import TRACKER, World, ball_plate_mm
from compd.units import UM_PER_MM
from gauge_log import GaugeLog, probe_ball
from reproduction import Reduction, Reproduction

# Time (s) that a person takes per ball, and rounds over the whole plate, there and back.
PER_BALL_S = 30.0
ROUNDS = 2


@dataclass(frozen=True)
class PlateResult:
    """The 136 distances between 17 balls. nominal_mm : (136,). Errors (136,), um, measured less certified."""

    nominal_mm: FloatArray
    without_um: FloatArray
    joints_um: FloatArray
    full_um: FloatArray


def run(configuration: Configuration, seed: int) -> PlateResult:
    """Measure the plate while the machine warms up, from machine zero at 20 degC (figures 19 and 20)."""
    world = World(configuration.geometry, configuration.wiring, seed)
    rng = np.random.default_rng([seed, 20])
    machine = world.mechanism
    balls = ball_plate_mm(machine.tip0_M if machine.tip_frame == "M" else machine.tip0_P)
    there = range(len(balls))
    order = [*there, *reversed(there)] * (ROUNDS // 2)
    gauge_log = GaugeLog()
    for ball in order:
        probe_ball(world, TRACKER.measure(balls[ball], rng))
        world.advance(PER_BALL_S)
        probe_ball(world, TRACKER.measure(balls[ball], rng))
        gauge_log.read(world)
    pairs = np.array(list(itertools.combinations(there, 2)))
    nominal_mm = _distances(balls, pairs)

    def errors_um(*, joints: bool, frame: bool) -> FloatArray:
        tips = gauge_log.tips_mm(configuration, joints=joints, frame=frame)
        places = np.array([tips[np.array(order) == ball].mean(axis=0) for ball in there])
        return (_distances(places, pairs) - nominal_mm) * UM_PER_MM

    return PlateResult(
        nominal_mm,
        errors_um(joints=False, frame=False),
        errors_um(joints=True, frame=False),
        errors_um(joints=True, frame=True),
    )


def reproduce(configuration: Configuration, seed: int) -> Reproduction:
    """Run and evaluate the experiment on this machine; seed : of joints, weather and noise."""
    result = run(configuration, seed)
    return Reproduction("Figure 20: distances between the balls of a 3D ball plate", reductions(result), panels(result))


def reductions(result: PlateResult) -> list[Reduction]:
    """Errors of the distances; figure 20 states 32 % less by compensation of the joints."""
    without = rms(result.without_um)
    return [
        Reduction("distances, rms, joints compensated", without, rms(result.joints_um), "32 % by the joints"),
        Reduction("distances, largest, joints compensated", *_largest(result.without_um, result.joints_um), "-"),
        Reduction("distances, rms, joints and frame compensated", without, rms(result.full_um), "-"),
    ]


def panels(result: PlateResult) -> list[Panel]:
    """Error of each distance by its length, as in figure 20."""
    figure = Figure()
    for name, errors_um, colour, symbol in (
        ("without compensation", result.without_um, "worst", "circle-open"),
        ("joints compensated", result.joints_um, "best", "circle"),
    ):
        figure.add_scatter(
            x=result.nominal_mm,
            y=errors_um,
            name=name,
            mode="markers",
            marker={"color": COLOURS[colour], "symbol": symbol, "size": 7},
        )
    figure.add_hline(y=0, line={"color": COLOURS["quiet"], "width": 1})
    return [
        Panel(
            "Deflection of measured distances",
            "Each dot is one of the 136 pairs of balls, measured less certified. "
            "How much is gained depends on how much of the error is the joints'; of the paper's machine it is not "
            "known.",
            style_figure(figure, "distance between balls, mm", "deflection, um", 440),
        ),
    ]


def _distances(places_mm: FloatArray, pairs: np.ndarray[tuple[int, int], np.dtype[np.int_]]) -> FloatArray:
    """(pairs,) distances between places (balls, 3)."""
    return np.asarray(np.linalg.norm(places_mm[pairs[:, 0]] - places_mm[pairs[:, 1]], axis=1))


def _largest(without_um: FloatArray, with_um: FloatArray) -> tuple[float, float]:
    return float(np.abs(without_um).max()), float(np.abs(with_um).max())
