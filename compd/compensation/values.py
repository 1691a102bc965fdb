"""What a compensation is computed from, and what it gives: one snapshot, or N rows of them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

from compd.arrays import FloatArray, IntArray
from compd.model import EffectMemory, MachineModel
from compd.model.kinematics import Frame


class GaugeValues(NamedTuple):
    """One snapshot, or N rows of them: changes since machine zero, signed as in equations (1), (6) and (7).

    scale_mm : (..., m).  joint_mm : (..., k), in the wiring's order.  frame_mm : (..., 9), t1..t3, u1..u6; (..., 6),
        u1..u6 alone, with t1..t3 as at machine zero; or (..., 0): the frame is taken to stand still.
    quantities : anything else by its name with unit (temperatures, forces), each (...): what effects need, or empty.
    time_s : (...), monotonic, for effects with a memory; rows follow each other in time.
    quantities_at_zero : the quantities at machine zero, by name: those from which effects count, or empty.
    """

    scale_mm: FloatArray
    joint_mm: FloatArray
    frame_mm: FloatArray
    quantities: Mapping[str, FloatArray]
    time_s: FloatArray | float = math.nan
    quantities_at_zero: Mapping[str, float] = MappingProxyType({})


class WarmStart(NamedTuple):
    """Where the last cycle ended and the next one's Newton starts; rows that failed keep what they came with.

    supports_M_mm : (..., 3, 3).  origin_M_mm : (..., 3), rotation_M_P : (..., 3, 3), of the moving platform.
    effects : what the model's effects remember; of N rows, after the last one.
    actuator_mm : (..., m); None in recordings that lack it: machine zero's.
    """

    supports_M_mm: FloatArray
    origin_M_mm: FloatArray
    rotation_M_P: FloatArray
    effects: EffectMemory = EffectMemory()
    actuator_mm: FloatArray | None = None

    @classmethod
    def at_zero(cls, model: MachineModel) -> WarmStart:
        """Machine zero: the first start, and the one that depends on no history."""
        zero = model.zero
        return cls(
            model.frame.zero_supports_M_mm,
            zero.platform_origin_M_mm,
            zero.rotation_M_P,
            actuator_mm=zero.actuator_mm,
        )


class Contributions(Mapping[str, FloatArray]):
    """The contribution (..., m) of each cause, by its name; their sum is the correction but for rounding."""

    def __init__(self, causes: Sequence[str], by_cause_mm: FloatArray) -> None:
        self.causes = causes  #: "joints", "frame", and the id of each effect
        self.by_cause_mm = by_cause_mm  #: (K, ..., m), in the order of `causes`.

    def __getitem__(self, cause: str) -> FloatArray:
        if cause not in self.causes:
            raise KeyError(cause)
        contribution_mm: FloatArray = self.by_cause_mm[self.causes.index(cause)]
        return contribution_mm

    def __iter__(self) -> Iterator[str]:
        return iter(self.causes)

    def __len__(self) -> int:
        return len(self.causes)


class Compensation(NamedTuple):
    """What one cycle computes; where reason is not OK every number is nan (frame has a reason of its own).

    tip_M_mm, tip_B0_mm : (..., 3), the tip in {M}, and in {B0} by equation (9). In CMM mode where it is now, in
        machine-tool mode where it will be when the setpoint is reached.
    tip_P_mm : (..., 3), the same place in {P}: with the tool on the plate, the place on the work that it touches.
    rotation_M_P : (..., 3, 3), attitude of the moving platform.
    frame : the machine frame now, with its displacement since machine zero.
    link_length_mm : (..., n): in CMM mode those measured, equation (1); in machine-tool mode those needed.
    target_B_mm : (..., 3), the target in today's {B}, equation (8).
    nominal_scale_mm : (..., m), the command without compensation.
    scale_setpoint_mm : (..., m), what the scales must show for the tip to be on the target.
    correction_mm : (..., m) = scale_setpoint_mm - nominal_scale_mm.
    contributions : the correction by cause, (..., m) each; of a machine without scales, and of an external one, that
        of the tip, (3) each.
    reason : (...), a Reason, of the step that failed first.
    rotation_M_rad : (3,), attitude of what carries the tip, as a rotation vector in {M}; None where it is not told.
    pose_correction : (6,), what is added to the commanded tip, mm, and to the commanded attitude, rad, in {B0}: the
        rotation is about the axes of {B0} and follows that of the command; nan where the attitude is not known. None
        where links are corrected and no pose.
    own_columns : what own kinematics gives for effects to read, by name; None of any other machine.
    """

    tip_M_mm: FloatArray
    tip_B0_mm: FloatArray
    tip_P_mm: FloatArray
    rotation_M_P: FloatArray
    frame: Frame
    link_length_mm: FloatArray
    target_B_mm: FloatArray
    nominal_scale_mm: FloatArray
    scale_setpoint_mm: FloatArray
    correction_mm: FloatArray
    contributions: Contributions
    reason: IntArray
    rotation_M_rad: FloatArray | None = None
    pose_correction: FloatArray | None = None
    own_columns: Mapping[str, float] | None = None


class Wanted(NamedTuple):
    """What machine-tool mode is to reach: the contact, tip_M_mm (..., 3) and tip_P_mm (..., 3), and the attitude
    (..., 3, 3) of {P} in {M}: a hexapod's; for a tripod the guess to start from."""

    tip_M_mm: FloatArray
    tip_P_mm: FloatArray
    attitude_M_P: FloatArray
