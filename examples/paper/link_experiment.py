"""Figure 18: one link is pulled, pushed and warmed; its scale is compared with a laser interferometer along it.

The link without the paper's device has its scale bolted to tube and screw, which stretch and grow; the one with it
has rods of Super-Invar from ball to scale (figure 5) and comparators in its joints (figure 3).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from plotly.graph_objects import Figure

from compd.arrays import FloatArray, rms
from compd.configuration import Configuration
from compd.machine_builder import joint_weights
from compd.report import COLOURS, Panel, style_figure
from compd.simulation import INTERFEROMETER, Cause, Heat, Mechanism, World, build_cause
from compd.units import UM_PER_MM
from gauge_log import GaugeLog
from reproduction import Reduction, Reproduction

LINK = 0
# Link without the device: expansion of steel (handbook), compliance of a screw drive of this size.
TUBE_PPM_PER_K = 11.0
TUBE_UM_PER_N = 1 / 30.0
# Loads on the tip along the link, N: up, down and back to zero, in steps of 10 N.
LOADS_N = np.concatenate([np.linspace(0, 60, 7), np.linspace(50, -60, 12), np.linspace(-50, 0, 6)])
LOAD_S = 10.0
# Heat (W) of a lamp beside the link: a few kelvin in two hours.
LAMP_W = 4.0
WARM_S, WARM_STEP_S = 7200.0, 240.0


@dataclass(frozen=True)
class LinkDifferences:
    """Length change by the gauges less that by the interferometer, um.

    axial_N, cold_um, warm_um : (N,) by load, before and after warming. link_degC, warming_um : (K,) while warming.
    """

    axial_N: FloatArray
    cold_um: FloatArray
    warm_um: FloatArray
    link_degC: FloatArray
    warming_um: FloatArray


@dataclass(frozen=True)
class LinkResult:
    """without : scale bolted to the link, no comparators. compensated : with the paper's device."""

    without: LinkDifferences
    compensated: LinkDifferences


def run(configuration: Configuration, seed: int) -> LinkResult:
    """Load and warm the link with and without the paper's device (figures 3, 5 and 18)."""
    mechanism = Mechanism(configuration.geometry)
    bolted = [
        build_cause("link_expansion", TUBE_PPM_PER_K, mechanism, seed),
        build_cause("link_elasticity", TUBE_UM_PER_N, mechanism, seed),
    ]
    return LinkResult(
        _measure_link(configuration, seed, bolted, compensated=False),
        _measure_link(configuration, seed, [], compensated=True),
    )


def _measure_link(
    configuration: Configuration, seed: int, causes: list[Cause], *, compensated: bool
) -> LinkDifferences:
    """Loading, warming, loading again. compensated : equation (1) with the joint comparators, else the scale alone."""
    world = World(configuration.geometry, configuration.wiring, seed, causes=causes)
    rng = np.random.default_rng([seed, 18])
    weights = joint_weights(configuration.wiring, world.mechanism.links)[LINK]
    machine = world.mechanism
    along_M = machine.posture0[0] + machine.joints_P[LINK] @ machine.posture0[1:] - machine.joints0_M[LINK]
    along_M = along_M / np.linalg.norm(along_M)
    still = np.zeros(machine.links)

    def difference_um(time_s: float) -> float:
        """The gauges' change of the link's length less the interferometer's."""
        world.advance_to(still, machine.posture0, time_s, 0.0)
        gauge_log = GaugeLog()
        gauge_log.read(world)
        gauge_mm = gauge_log.scale_mm[0][LINK]
        if compensated:
            gauge_mm -= float(weights @ gauge_log.joint_mm[0])  # equation (1)
        true_mm = INTERFEROMETER.measure(world.link_change_mm()[[LINK]], rng)[0]
        return (gauge_mm - float(true_mm)) * UM_PER_MM

    def loading() -> tuple[FloatArray, FloatArray]:
        axial, differences = [], []
        for load_N in LOADS_N:
            world.force_M_N = load_N * along_M
            differences.append(difference_um(LOAD_S))
            axial.append(float(world.axial_N()[LINK]))
        world.force_M_N = np.zeros(3)
        return np.array(axial), np.array(differences)

    axial_N, cold_um = loading()
    world.heat(Heat(LAMP_W * (np.arange(machine.links) == LINK), 0.0, np.zeros(3), 0.0, 0.0, 0.0))
    link_degC, warming_um = [], []
    for _ in range(int(WARM_S / WARM_STEP_S)):
        warming_um.append(difference_um(WARM_STEP_S))
        link_degC.append(world.sense(f"temperature_link_{LINK + 1}_degC"))
    _, warm_um = loading()
    return LinkDifferences(axial_N, cold_um, warm_um, np.array(link_degC), np.array(warming_um))


def reproduce(configuration: Configuration, seed: int) -> Reproduction:
    """Run and evaluate the experiment on this machine; seed : of joints, weather and noise."""
    result = run(configuration, seed)
    return Reproduction("Figure 18: scale unit against laser interferometer", reductions(result), panels(result))


def reductions(result: LinkResult) -> list[Reduction]:
    """Peak-to-peak differences under load and while warming, and the rms of all; figure 18 states no numbers."""
    return [
        Reduction(
            "difference under load, peak to peak",
            float(np.ptp(result.without.cold_um)),
            float(np.ptp(result.compensated.cold_um)),
            "considerably decreases; no number",
        ),
        Reduction(
            "difference while warming up, peak to peak",
            float(np.ptp(result.without.warming_um)),
            float(np.ptp(result.compensated.warming_um)),
            "decreases; no number",
        ),
        Reduction(
            "difference, load and warmth, rms",
            rms([*result.without.cold_um, *result.without.warm_um]),
            rms([*result.compensated.cold_um, *result.compensated.warm_um]),
            "-",
        ),
    ]


def panels(result: LinkResult) -> list[Panel]:
    """Difference by axial force, and by the link's temperature."""
    load, warmth = Figure(), Figure()
    for name, differences, colour in (
        ("without", result.without, "worst"),
        ("with compensation", result.compensated, "best"),
    ):
        for state, differences_um, symbol in (
            ("20 degC", differences.cold_um, "circle"),
            ("warm", differences.warm_um, "diamond-open"),
        ):
            load.add_scatter(
                x=differences.axial_N,
                y=differences_um,
                name=f"{name}, {state}",
                mode="lines+markers",
                line={"color": COLOURS[colour], "width": 1},
                marker={"symbol": symbol, "size": 7},
            )
        warmth.add_scatter(
            x=differences.link_degC,
            y=differences.warming_um,
            name=name,
            mode="lines+markers",
            line={"color": COLOURS[colour]},
        )
    return [
        Panel(
            "Under external load",
            "Scale unit less interferometer, at 20 degC and after two hours beside a lamp.",
            style_figure(load, "axial force of the link, N", "difference, um", 440),
        ),
        Panel(
            "While the link warms up",
            "The same without load.",
            style_figure(warmth, "temperature of the link, degC", "difference, um", 340),
        ),
    ]
