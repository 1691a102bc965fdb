"""What goes into a cycle: the state that the last one left, this cycle's inputs, and settings that stay."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np

from compd.arrays import FloatArray
from compd.compensation import WarmStart
from compd.errors import StateError
from compd.link_count import scale_count
from compd.live.loop.commands import Target
from compd.live.loop.stale_policy import ComparatorSet
from compd.live.loop.tip_uncertainty import scatter_limits_mm
from compd.live.machine import MachineWires, MachineZero, Models
from compd.live.memory import Snapshot
from compd.model import EffectMemory, GaugeNoise, MachineModel
from compd.model.external import ExternalModel
from compd.operation_settings import LimitSettings, LoopSettings

# The uncertainty of the tip changes over seconds, as the machine warms up or crosses its workspace.
_UNCERTAINTY_EVERY_S = 1.0
# Over tenths of a second where a gauge begins to scatter.
_SCATTERING_EVERY_S = 0.2


class ZeroVectors(NamedTuple):
    """Raw readings at machine zero in the order of the wiring: scale_mm (n), comparators_mm (k + 9)."""

    scale_mm: FloatArray
    comparators_mm: FloatArray


class CycleState(NamedTuple):
    """What one cycle hands to the next. Nothing in it is ever changed in place.

    A recording keeps all fields but two: `zero_vectors` and `models` follow from the inputs of the same cycle.
    """

    #: the machine zero that was used last; None before the first. With another one, the cycle forgets what was measured
    #: from it.
    zero: MachineZero | None
    warm_start: WarmStart  #: where Newton's iterations start, with the memory of the applied model's effects
    #: (n), the correction that is applied; the next one slews from it. An invalid cycle keeps it. Of a machine without
    #: scales the correction of its pose (6), mm and rad, after the first valid cycle.
    correction_mm: FloatArray
    last_good: ComparatorSet | None = None  #: the newest complete set of comparators; None before the first
    #: whether the scales have ever been good. Scales that are lost afterwards are `stop`, not `starting`.
    scales_seen: bool = False
    shadow_memory: EffectMemory = EffectMemory()  #: memory of the shadow model's effects
    adopting: bool = False  #: whether the correction is still slewing towards that of a newly adopted model
    #: as `TipUncertainty.by_noise_um`; None where that has not been computed. In recordings of releases up to 0.2.0
    #: (3), without the radius.
    tip_noise_um: FloatArray | None = None
    #: (n), the correction with which the last tip of CMM mode was computed; None where the last setpoint was invalid or
    #: in the other mode
    tip_correction_mm: FloatArray | None = None
    zero_vectors: ZeroVectors | None = None  #: the readings of `zero`; None where they have yet to be read from it
    models: Models | None = None  #: those of the last cycle; None before the first
    #: (3, n + k + 9), by how much a length moves the tip, computed with `tip_noise_um`; None without it
    tip_by_gauge: FloatArray | None = None

    @classmethod
    def at_start(cls, model: MachineModel) -> Self:
        """The state before the first cycle: at machine zero, with no correction applied."""
        return cls(None, WarmStart.at_zero(model), np.zeros(scale_count(model.links)))


class CycleInputs(NamedTuple):
    """What is new in one cycle: its number, the gauges, and the commands as they are at its start.

    tick : number of the cycle. zero : StateError says why there is none. target : None in CMM mode.
    models : None is the machine without effects. ending : why the correction is to be held, which is done for a moment
    before the daemon ends; "" otherwise.
    """

    tick: int
    snapshot: Snapshot
    zero: MachineZero | StateError
    target: Target | None = None
    models: Models | None = None
    ending: str = ""


@dataclass(frozen=True, eq=False)
class CycleSettings:
    """What does not change from cycle to cycle.

    without_effects : the machine's model without effects, which is used where no other is commanded.
    valid_for_s : how long a setpoint may be used.
    stroke_mm : shortest and longest link; None where the configuration does not give them.
    noise : standard deviations of the gauges; None where one of them is not given: no uncertainty is computed then.
    scales_checked : whether machine-tool mode compares the scales with the setpoints (`votes.following_mm`).
    """

    without_effects: Models
    wires: MachineWires
    loop: LoopSettings
    limits: LimitSettings
    valid_for_s: float
    stroke_mm: tuple[float, float] | None = None
    noise: GaugeNoise | None = None
    scales_checked: bool = False

    @cached_property
    def model(self) -> MachineModel:
        """The machine without effects."""
        return self.without_effects.applied.machine

    @cached_property
    def corrects_pose(self) -> bool:
        """Whether the pose is corrected that a controller commands, since there are no scales."""
        return not self.wires.scale.wires

    @cached_property
    def has_own_pose(self) -> bool:
        """Whether own kinematics or a client gives the pose."""
        return isinstance(self.model, ExternalModel)

    @cached_property
    def commands_pose(self) -> bool:
        """Whether the pose to command follows from the drawing, for a controller whose machine has no scales."""
        return self.corrects_pose and not self.has_own_pose

    @cached_property
    def period_s(self) -> float:
        """Seconds from tick to tick."""
        return 1.0 / self.loop.rate_hz

    @cached_property
    def largest_skew_s(self) -> float:
        """How far apart in time the lengths of a setpoint may be, s; inf without a limit."""
        return math.inf if self.loop.skew_s is None else self.loop.skew_s

    @cached_property
    def uncertainty_every(self) -> int:
        """Cycles from one computation of the tip's uncertainty to the next."""
        return max(1, round(_UNCERTAINTY_EVERY_S * self.loop.rate_hz))

    @cached_property
    def scattering_every(self) -> int:
        """The same while a length scatters by far more than is stated."""
        return max(1, round(_SCATTERING_EVERY_S * self.loop.rate_hz))

    @cached_property
    def scatter_limits_mm(self) -> FloatArray:
        """As `tip_uncertainty.scatter_limits_mm`; inf where no noise is known."""
        return np.full(1, math.inf) if self.noise is None else scatter_limits_mm(self.noise)

    @cached_property
    def unread_scales_mm(self) -> FloatArray:
        """(m,) nan: scales in machine-tool mode, which does not use them."""
        return np.full(scale_count(self.model.links), math.nan)
