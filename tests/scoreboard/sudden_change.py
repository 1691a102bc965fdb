"""A cause that changes in the middle of a recording: a head that was knocked, a play that has become larger."""

from __future__ import annotations

import numpy as np

from compd.arrays import FloatArray
from compd.simulation.truth.cause import Cause, CauseInputs, Interval
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.warm_up import WarmUp


class NoCause(Cause):
    """Stands for a cause before its beginning: adds nothing."""

    id = "nothing"
    unit = "1"
    max_strength = 0.0

    def __init__(self, mechanism: Mechanism) -> None:
        super().__init__(0.0, mechanism, np.random.default_rng(0))


class SuddenChange(Cause):
    """The cause `before` up to `time_s` after switch-on, the cause `after` from then on.

    Both have the same memory of what the machine did, so that a play that grows is what it would be had it always been
    so large. Revolute axes cannot change: they are fixed when the machine is built.
    """

    id = "sudden_change"
    unit = "1"
    max_strength = np.inf

    def __init__(self, before: Cause, after: Cause, time_s: float) -> None:
        self.before, self.after, self.time_s = before, after, time_s
        self._passed_s = 0.0
        self.remembers_readings = before.remembers_readings or after.remembers_readings
        self.strength, self.mechanism, self.part_strengths = after.strength, after.mechanism, after.part_strengths

    @property
    def _acting(self) -> Cause:
        return self.before if self._passed_s < self.time_s else self.after

    def pass_time(self, interval: Interval, warm: WarmUp) -> None:
        self._passed_s += interval.weather_s
        self.before.pass_time(interval, warm)
        self.after.pass_time(interval, warm)

    def link_extension_mm(self, inputs: CauseInputs) -> FloatArray | float:
        return self._acting.link_extension_mm(inputs)

    def scale_extension_mm(self, inputs: CauseInputs) -> FloatArray | float:
        return self._acting.scale_extension_mm(inputs)

    def base_shift_M(self, inputs: CauseInputs) -> FloatArray | float:
        return self._acting.base_shift_M(inputs)

    def platform_shift_P(self, inputs: CauseInputs) -> FloatArray | float:
        return self._acting.platform_shift_P(inputs)

    def tool_shift(self, inputs: CauseInputs) -> FloatArray | float:
        return self._acting.tool_shift(inputs)

    def reference_shift(self, inputs: CauseInputs) -> FloatArray | float:
        return self._acting.reference_shift(inputs)

    def scale_reading_mm(self, scale_mm: FloatArray) -> FloatArray:
        return self._acting.scale_reading_mm(scale_mm)

    def joint_reading_mm(self, joint_mm: FloatArray) -> FloatArray:
        return self._acting.joint_reading_mm(joint_mm)

    def frame_reading_mm(self, frame_mm: FloatArray, warm: WarmUp) -> FloatArray:
        return self._acting.frame_reading_mm(frame_mm, warm)
