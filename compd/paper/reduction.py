"""What the paper's experiments have in common: reading the simulated machine's gauges by the model, and reductions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from compd.arrays import FloatArray
from compd.compensation import GaugeValues, WarmStart, compensate_cmm
from compd.configuration import Configuration
from compd.machine_builder import build_model
from compd.simulation.truth.frame import DISTANCES
from compd.simulation.truth.world import World

HEAD = ("", "without", "with", "reduction", "the paper")


@dataclass
class Readings:
    """Every scale, joint and frame gauge, row by row; mm."""

    scale_mm: list[list[float]] = field(default_factory=list)
    joint_mm: list[list[float]] = field(default_factory=list)
    frame_mm: list[list[float]] = field(default_factory=list)

    def read(self, world: World) -> None:
        names = world.names
        self.scale_mm.append([world.sense(name) for name in names if name.startswith("scale_")])
        self.joint_mm.append([world.sense(name) for name in names if name.startswith("joint_")])
        self.frame_mm.append([world.sense(f"frame_{name}") for name in DISTANCES])

    def tips_mm(self, configuration: Configuration, *, joints: bool, frame: bool) -> FloatArray:
        """(N, 3) the tip in {M}, in CMM mode; comparators that are not used count as unmoved.

        With the tool on the plate: the place in {P} that it touches.
        """
        model = build_model(configuration.geometry, configuration.wiring)
        values = GaugeValues(
            np.array(self.scale_mm), joints * np.array(self.joint_mm), frame * np.array(self.frame_mm), {}
        )
        result, _ = compensate_cmm(model, values, WarmStart.at_zero(model))
        return result.tip_M_mm if configuration.geometry.tool.on == "platform" else result.tip_P_mm


@dataclass(frozen=True)
class Reduction:
    """One quantity without and with compensation, and what the paper states about it."""

    what: str
    without_um: float
    with_um: float
    paper: str

    @property
    def percent(self) -> float:
        return 100 * (1 - self.with_um / self.without_um)


def row(reduction: Reduction) -> Sequence[str]:
    return (
        reduction.what,
        f"{reduction.without_um:.2f} um",
        f"{reduction.with_um:.2f} um",
        f"{reduction.percent:.0f} %",
        reduction.paper,
    )


def rms(values: ArrayLike) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
