"""The protocol of a physical cause: which quantities it depends on, and which displacements it adds.

A cause is an error source that neither the drawing nor the gauges account for. The equilibrium adds the displacements
of all causes to the parts before it closes the mechanism; nothing computes a tip error directly.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from compd.arrays import FloatArray
from compd.simulation.truth.closure import Posture
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.warm_up import WarmUp
from compd.simulation.truth.weather import STANDARD_AIR, AirAtZero

PPM = 1e-6
UM = 1e-3
URAD = 1e-6


@dataclass(frozen=True)
class CauseInputs:
    """State of the machine at one instant, from which causes compute their displacements.

    It is the first of two passes of the equilibrium: micrometres that forces and causes add are not in it yet.

    scale_mm, link_mm : (n,) true scale positions; link lengths between joint centres.
    directions_M : (n, 3) unit vectors from base to platform joint.
    axial_N, axial0_N : (n,) link forces including the platform's weight, now and at machine zero; tension positive.
    force_M_N : (3,) external load on the tip. tip_M : (3,) tip, mm. posture : (4, 3) of the platform.
    warm : temperatures of all bodies. time_s : seconds since switch-on, in weather time.
    pressure_hPa, humidity_pct : of the air. air0 : the air at machine zero.
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
    air0: AirAtZero = STANDARD_AIR


@dataclass(frozen=True)
class Interval:
    """Time between two instants, in which the links went straight from start to end and then stood still.

    start_mm, end_mm : (n,) scale positions. travel_s : part of time_s that was spent moving.
    weather_s : time_s in weather time (multiplied by the world's speedup).
    """

    start_mm: FloatArray
    end_mm: FloatArray
    travel_s: float
    time_s: float
    weather_s: float


class Cause:
    """Base class of all causes. Methods that a subclass does not override add nothing.

    Class attributes
    ----------------
    id : name, as in `--effect`. unit : of the strength as a person states it.
    min_strength, max_strength : plausible range of the strength's magnitude; `signed`: either sign is plausible.
    stated_as_reciprocal : a person states 1/strength (a stiffness), the cause computes with strength (a compliance).
    in_library : the effect library has an effect of the same id. If not, `covariates` names the recorded quantities
        by which the cause can be described.
    only_in_motion : no effect while the machine is at rest.
    remembers_readings : its memory holds readings, so that it depends on when the gauges are read.
    acts_on_frame : it acts on the plate, or on what measures the frame, which a machine may not have.
    acts_on_joint_comparators : it acts on them alone, which a machine may not have.
    """

    acts_on_frame: ClassVar[bool] = False
    acts_on_joint_comparators: ClassVar[bool] = False
    id: ClassVar[str]
    unit: ClassVar[str]
    max_strength: ClassVar[float]
    min_strength: ClassVar[float] = 0.0
    stated_as_reciprocal: ClassVar[bool] = False
    signed: ClassVar[bool] = False
    in_library: ClassVar[bool] = True
    covariates: ClassVar[tuple[str, ...]] = ()
    only_in_motion: ClassVar[bool] = False
    remembers_readings: bool = False

    def __init__(self, strength: float, mechanism: Mechanism, rng: np.random.Generator) -> None:
        """`rng`: for scatter from part to part. The same seed gives the same parts at every strength."""
        self.strength = strength  #: in `unit` (its reciprocal where `stated_as_reciprocal`)
        self.mechanism = mechanism  #: the machine as drawn
        #: strength of every single part (link, coordinate), any shape, in `unit`
        self.part_strengths: FloatArray = np.array([strength])

    @classmethod
    def applies_to(cls, mechanism: Mechanism) -> bool:
        """Whether this machine has the part that the cause acts on."""
        return mechanism.has_frame or not cls.acts_on_frame

    @property
    def values(self) -> tuple[float, ...]:
        """`part_strengths`, flat."""
        return tuple(self.part_strengths.ravel().tolist())

    def pass_time(self, interval: Interval, warm: WarmUp) -> None:
        """Update the memory of a cause that has one; `warm`: temperatures at the interval's end."""

    # --- displacements, mm ------------------------------------------------------------------------------

    def link_extension_mm(self, inputs: CauseInputs) -> FloatArray | float:
        """(n,) true change of each link's length that scale and joint comparators do not measure."""
        return 0.0

    def base_shift_M(self, inputs: CauseInputs) -> FloatArray | float:
        """(n, 3) displacement of the base joint centres in {M}."""
        return 0.0

    def platform_shift_P(self, inputs: CauseInputs) -> FloatArray | float:
        """(n, 3) displacement of the platform joint centres in {P}."""
        return 0.0

    def scale_extension_mm(self, inputs: CauseInputs) -> FloatArray | float:
        """(m,) by how much each actuator is farther than its scale shows."""
        return 0.0

    def tilted_axes_P(self, axes_P: FloatArray) -> FloatArray:
        """(3, 3) revolute axes in {P} after this cause. Called once, when the machine is built."""
        return axes_P

    def tool_shift(self, inputs: CauseInputs) -> FloatArray | float:
        """(3,) displacement of the tip against what carries the tool: in {P} on the platform, in {M} on the plate."""
        return 0.0

    def reference_shift(self, inputs: CauseInputs) -> FloatArray | float:
        """(3,) error, in {M}, of a reference instrument that stands on the surface plate."""
        return 0.0

    # --- gauge errors: true value -> value that the gauge measures, mm --------------------------------------

    def scale_reading_mm(self, scale_mm: FloatArray) -> FloatArray:
        """(n,) linear scales."""
        return scale_mm

    def joint_reading_mm(self, joint_mm: FloatArray) -> FloatArray:
        """(k,) joint comparators, in the wiring's order."""
        return joint_mm

    def frame_reading_mm(self, frame_mm: FloatArray, warm: WarmUp) -> FloatArray:
        """(9,) frame comparators t1 t2 t3 u1 .. u6."""
        return frame_mm


def unit_rms_scatter(rng: np.random.Generator, *shape: int) -> FloatArray:
    """Normally distributed values of this shape, scaled to a root mean square of exactly 1."""
    values = rng.standard_normal(shape)
    return np.asarray(values / np.sqrt(np.mean(values**2)))


def uniform_scatter(rng: np.random.Generator, count: int) -> FloatArray:
    """(count,) factors of nominally equal parts: uniform between 0.75 and 1.25."""
    return rng.uniform(0.75, 1.25, count)
