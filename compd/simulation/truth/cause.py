"""A physical cause that the drawing and the gauges know nothing of: what it feels, and what it displaces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from compd.arrays import FloatArray
from compd.simulation.truth.closure import Posture
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.warm_up import WarmUp

PPM = 1e-6
UM = 1e-3
URAD = 1e-6
Values = tuple[float, ...]


@dataclass(frozen=True)
class CauseInputs:
    """The machine at one instant, nearly in equilibrium: what a cause can feel.

    scale_mm, link_mm : (n,) what the scales stand at, and how long the links are.
    directions_M : (n, 3) from base to platform.
    axial_N, axial0_N : (n,) link forces with the weight, now and at machine zero, tension positive.
    force_M_N : (3,) load on the tip. tip_M : (3,) mm. posture : of the platform.
    time_s : weather's seconds since the machine was switched on.
    """

    scale_mm: FloatArray
    link_mm: FloatArray
    directions_M: FloatArray
    axial_N: FloatArray
    axial0_N: FloatArray
    force_M_N: FloatArray
    tip_M: FloatArray
    posture: Posture
    warm: WarmUp
    time_s: float
    pressure_hPa: float
    humidity_pct: float


@dataclass(frozen=True)
class Interval:
    """What happened between two instants: the links went straight from start to end, and stood there.

    travel_s of time_s were spent moving; weather_s is time_s as weather and warm-up count it.
    """

    start_mm: FloatArray
    end_mm: FloatArray
    travel_s: float
    time_s: float
    weather_s: float


class Cause:
    """One cause. What it does not touch stays as it is; a displacement is added where the part sits.

    id, unit : of the strength. least, most : the smallest and largest that are plausible, either way where `signed`.
    reciprocal : whether a person states 1/strength: a stiffness, where the cause needs what gives.
    in_library : whether the effect library has it, under the same id; if not, `follows` says what it depends on.
    in_motion : whether it acts on the move alone.
    """

    id: ClassVar[str]
    unit: ClassVar[str]
    most: ClassVar[float]
    least: ClassVar[float] = 0.0
    reciprocal: ClassVar[bool] = False
    signed: ClassVar[bool] = False
    in_library: ClassVar[bool] = True
    follows: ClassVar[tuple[str, ...]] = ()
    in_motion: ClassVar[bool] = False

    def __init__(self, strength: float, machine: Mechanism, rng: np.random.Generator) -> None:
        """`rng`: for what differs from part to part; the same seed gives the same parts at every strength."""
        self.strength = strength
        self.machine = machine

    @property
    def values(self) -> Values:
        """The strength, or that of every part of its own, in `unit`."""
        return (self.strength,)

    def pass_time(self, travel: Interval, warm: WarmUp) -> None:
        """Only causes with a memory care; `warm` is as at the end."""

    # --- displacements, mm ------------------------------------------------------------------------------

    def link_mm(self, now: CauseInputs) -> FloatArray | float:
        """(n,) by which the joints of each link are farther apart than scale and comparators tell."""
        return 0.0

    def base_M(self, now: CauseInputs) -> FloatArray | float:
        """(n, 3) of the base joints."""
        return 0.0

    def platform_P(self, now: CauseInputs) -> FloatArray | float:
        """(n, 3) of the platform joints."""
        return 0.0

    def axes_P(self, axes_P: FloatArray) -> FloatArray:
        """The revolute axes, (3, 3); once, when the machine is built."""
        return axes_P

    def tool(self, now: CauseInputs) -> FloatArray | float:
        """(3,) of the tip against what carries the tool: in {P} on the platform, in {M} on the plate."""
        return 0.0

    def reference(self, now: CauseInputs) -> FloatArray | float:
        """(3,) in {M}: by how much a reference instrument that stands on the plate shows another place."""
        return 0.0

    # --- what gauges make of what is there, mm --------------------------------------------------------------

    def scale_seen(self, scale_mm: FloatArray) -> FloatArray:
        return scale_mm

    def joint_seen(self, joint_mm: FloatArray) -> FloatArray:
        return joint_mm

    def frame_seen(self, frame_mm: FloatArray, warm: WarmUp) -> FloatArray:
        return frame_mm


def parts(rng: np.random.Generator, *shape: int) -> FloatArray:
    """Parts that differ: normal, of root mean square 1."""
    values = rng.standard_normal(shape)
    return np.asarray(values / np.sqrt(np.mean(values**2)))


def alike(rng: np.random.Generator, count: int) -> FloatArray:
    """(count,) parts of one kind: 1, give or take a quarter."""
    return rng.uniform(0.75, 1.25, count)
