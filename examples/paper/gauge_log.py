"""Balls probed by the simulated machine; its gauges logged row by row and evaluated by the model."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from compd.arrays import FloatArray
from compd.compensation import GaugeValues, WarmStart, compensate_cmm
from compd.configuration import Configuration
from compd.machine_builder import build_model
from compd.simulation import DISTANCES, PROBING_STEP_S, World, probing_steps_mm


@dataclass
class GaugeLog:
    """Readings of every scale, joint comparator and frame comparator, one row per call of `read`; mm."""

    scale_mm: list[list[float]] = field(default_factory=list)
    joint_mm: list[list[float]] = field(default_factory=list)
    frame_mm: list[list[float]] = field(default_factory=list)

    def read(self, world: World) -> None:
        """Append a row."""
        names = world.names
        self.scale_mm.append([world.sense(name) for name in names if name.startswith("scale_")])
        self.joint_mm.append([world.sense(name) for name in names if name.startswith("joint_")])
        self.frame_mm.append([world.sense(f"frame_{name}") for name in DISTANCES])

    def tips_mm(self, configuration: Configuration, *, joints: bool, frame: bool) -> FloatArray:
        """(N, 3) tip in CMM mode, paper equation (9): in {M}, or in {P} with the tool on the plate.

        joints, frame : whether these comparators are used; otherwise their readings are replaced by 0, which is a
        machine without compensation.
        """
        model = build_model(configuration.geometry, configuration.wiring)
        values = GaugeValues(
            np.array(self.scale_mm), joints * np.array(self.joint_mm), frame * np.array(self.frame_mm), {}
        )
        result, _ = compensate_cmm(model, values, WarmStart.at_zero(model))
        return result.tip_M_mm if configuration.geometry.tool.on == "platform" else result.tip_P_mm


def probe_ball(world: World, ball: FloatArray) -> None:
    """Move to `ball` with the attitude of machine zero and probe it."""
    mechanism = world.mechanism
    posture = mechanism.posture_at(ball, np.zeros(3))
    world.advance_to(mechanism.scales_at(posture), posture, 4 * PROBING_STEP_S, 2 * PROBING_STEP_S)
    for scale_mm in probing_steps_mm(world, ball, posture):
        world.advance_to(scale_mm, posture, PROBING_STEP_S, PROBING_STEP_S / 2)
