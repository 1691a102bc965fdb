"""Static equilibrium of the machine: parts displaced by heat, forces and causes, then the mechanism's closure."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.errors import KinematicsError
from compd.simulation.truth.cause import Cause, CauseInputs
from compd.simulation.truth.closure import Closure, Posture, homogeneous
from compd.simulation.truth.frame import PPM, Frame
from compd.simulation.truth.joints import Balls, Joints, link_directions
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.strengths import Strengths
from compd.simulation.truth.warm_up import WarmUp
from compd.simulation.truth.weather import Weather

# Cosine of the largest tilt of the platform from its attitude at machine zero, 60 degrees.
MIN_UPRIGHT = 0.5


@dataclass(frozen=True)
class EquilibriumState:
    """True state of the machine at one instant; mm, N.

    scale_mm : (n,). posture : (4, 3) of the platform. supports_M, plate_M : (3, 3).
    link_mm : (n,) true distances between each link's joint centres, the l of equation (1).
    axial_N : (n,) link forces less those at machine zero, tension positive.
    tip_M, tip_P : (3,). shown : (3,) tip as a reference instrument without noise shows it, in the mechanism's
    `tip_frame`.
    """

    scale_mm: FloatArray
    posture: Posture
    supports_M: FloatArray
    plate_M: FloatArray
    balls: Balls
    link_mm: FloatArray
    axial_N: FloatArray
    tip_M: FloatArray
    tip_P: FloatArray
    shown: FloatArray


class _Warmed(NamedTuple):
    """The parts at their present temperatures, without forces; mm.

    of : the temperatures for which it is right, by identity. rods_mm : (n,) growth of the rods. unloaded_M : (3, 3)
    supports. base_M : (n, 3) base joints with the actuators at machine zero. stretch, tool : relative.
    """

    of: FloatArray
    stretch: float
    tool: float
    joints_P: FloatArray
    rods_mm: FloatArray
    unloaded_M: FloatArray
    base_M: FloatArray
    plate_M: FloatArray
    closure: Closure


class Equilibrium:
    """Solver for the state at given scale values, with the present temperatures, weather and causes."""

    def __init__(
        self,
        mechanism: Mechanism,
        strengths: Strengths,
        frame: Frame,
        joints: Joints,
        causes: Sequence[Cause],
        warm: WarmUp,
        weather: Weather,
    ) -> None:
        self._mechanism, self._strengths, self._frame, self._joints = mechanism, strengths, frame, joints
        self._causes, self._warm, self._weather = causes, warm, weather
        self._warmed: _Warmed | None = None
        axes_P = mechanism.axes_P
        for cause in causes:
            axes_P = cause.tilted_axes_P(axes_P)
        self._closure = Closure(axes_P, mechanism.link_of_axis, mechanism.hinge_on_base)
        self._axial0_N, self._lateral0_M = self._forces(
            self._closure, mechanism.posture0, mechanism.joints0_M, mechanism.joints_P, np.zeros(3)
        )

    def solve(self, scale_mm: FloatArray, guess: Posture, force_M_N: FloatArray) -> EquilibriumState:
        """State at scale values (m,) under the load (3,) on the tip; `guess`: a posture near by.

        Two passes: first closure and forces with thermal displacements alone, then all displacements that follow from
        them. Forces and joint angles change by parts per million in between, so that no third pass is needed.

        Raises KinematicsError if the links cannot meet.
        """
        warm, machine, causes = self._warm, self._mechanism, self._causes
        _, stretch, _, joints_P, rods_mm, unloaded_M, base_M, plate_M, closure = self._warmed_parts()
        lengths_mm = machine.lengths_at(scale_mm) + rods_mm
        if machine.moves_base:
            base_M = machine.base_joints_M(unloaded_M, stretch, scale_mm)
        posture = closure.by_lengths(base_M, joints_P, lengths_mm, guess)
        total_N, total_lateral_M = self._forces(closure, posture, base_M, joints_P, force_M_N)
        axial_N, lateral_M = total_N - self._axial0_N, total_lateral_M - self._lateral0_M

        directions_M = link_directions(base_M, homogeneous(joints_P) @ posture)
        pull_M = machine.carries @ (axial_N[:, None] * directions_M + lateral_M)
        supports_M = unloaded_M + self._frame.give_M(pull_M)
        balls = self._joints.balls(posture, directions_M, axial_N, lateral_M)
        inputs = CauseInputs(
            scale_mm,
            lengths_mm,
            directions_M,
            total_N,
            self._axial0_N,
            force_M_N,
            self._tip(posture)[0],
            posture,
            warm,
            warm.time_s,
            self._weather.pressure_hPa(warm.time_s),
            self._weather.humidity_pct(warm.time_s),
            self._weather.at_zero,
        )
        beyond_mm = np.zeros(machine.scales) + _sum(cause.scale_extension_mm(inputs) for cause in causes)
        link_mm = (
            lengths_mm
            + balls.base_along_mm
            - balls.platform_along_mm
            + _sum(cause.link_extension_mm(inputs) for cause in causes)
            + machine.extensions(beyond_mm)
        )
        closure = machine.turned_with_base(self._closure, supports_M)
        posture = closure.by_lengths(
            machine.base_joints_M(supports_M, stretch, scale_mm + beyond_mm)
            + balls.base_across_M
            + _sum(cause.base_shift_M(inputs) for cause in causes),
            joints_P + balls.platform_across_P + _sum(cause.platform_shift_P(inputs) for cause in causes),
            link_mm,
            posture,
        )
        if posture[3] @ machine.posture0[3] < MIN_UPRIGHT:
            raise KinematicsError.of(
                "simulated machine",
                "the platform would tip over at these scale values",
                value=np.array2string(scale_mm, precision=3),
                next_step="ask for a place nearer to machine zero",
            )
        tip_M, tip_P = self._tip(posture, _sum(cause.tool_shift(inputs) for cause in causes))
        shown = (tip_M if machine.tip_frame == "M" else tip_P) + _sum(cause.reference_shift(inputs) for cause in causes)
        return EquilibriumState(scale_mm, posture, supports_M, plate_M, balls, link_mm, axial_N, tip_M, tip_P, shown)

    def _warmed_parts(self) -> _Warmed:
        """The parts as they are now; computed once for each step of the temperatures."""
        warm, machine, strengths = self._warm, self._mechanism, self._strengths
        if self._warmed is not None and self._warmed.of is warm.bodies_degC:
            return self._warmed
        stretch = strengths.support_expansion_ppm_per_K * PPM * warm.since_zero_K("base")
        platform = strengths.platform_expansion_ppm_per_K * PPM * warm.since_zero_K("platform")
        unloaded_M = self._frame.unloaded_M(warm)
        self._warmed = _Warmed(
            warm.bodies_degC,
            stretch,
            1 + strengths.tool_expansion_ppm_per_K * PPM * warm.since_zero_K("tool"),
            machine.joints_P * (1 + platform),
            # rods between the balls and the scale (paper, figure 5) are part of the link
            strengths.scale_rod_expansion_ppm_per_K * PPM * warm.links_K * machine.lengths0_mm,
            unloaded_M,
            machine.base_joints_M(unloaded_M, stretch),
            self._frame.plate_M(warm),
            machine.turned_with_base(self._closure, unloaded_M),
        )
        return self._warmed

    def _tip(self, posture: Posture, displaced: FloatArray | float = 0.0) -> tuple[FloatArray, FloatArray]:
        """The tip in {M} and in {P}, (3,) each; `displaced`: of the tip against what carries the tool."""
        machine = self._mechanism
        tool = self._warmed_parts().tool
        if machine.tip_frame == "M":
            tip_P = machine.tip0_P * tool + displaced
            return homogeneous(tip_P) @ posture, tip_P
        tip_M = machine.tip0_M * tool + displaced
        return tip_M, posture[1:] @ (tip_M - posture[0])

    def _forces(
        self, closure: Closure, posture: Posture, base_M: FloatArray, joints_P: FloatArray, force_M_N: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        machine = self._mechanism
        tip_P = machine.tip0_P
        if machine.tip_frame == "P":
            tip_P = posture[1:] @ (machine.tip0_M - posture[0])
        loads = [(machine.weight_M, machine.weight_at_P), (force_M_N, tip_P)]
        return closure.forces(posture, base_M, joints_P, loads)


def _sum(displacements: Iterable[FloatArray | float]) -> FloatArray | float:
    total: FloatArray | float = 0.0
    for displacement in displacements:
        if isinstance(displacement, np.ndarray) or displacement != 0:
            total = total + displacement
    return total
