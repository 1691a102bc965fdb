"""Commands of clients to the loop: machine zero, target and models."""

from __future__ import annotations

import math
from copy import copy
from dataclasses import dataclass

from compd.errors import StateError
from compd.live.machine import MachineZero, Models
from compd.live.memory import SharedMessage

_TARGET_BYTES = 2048


@dataclass(frozen=True)
class Target:
    """Where a controller wants the tip.

    tip_mm : (3), in {B0}; with the tool on the plate the place on the work, in {P}.
    rotation_B0_rad : (3), rotation vector of {P} in {B0}; without it the attitude is that at machine zero. The attitude
        of a tripod follows from its tip.
    valid_until_s : monotonic time (s) after which it is too old to be used; never without it.
    time_s : monotonic time (s) at which it was made or, where the controller does not say, came; unknown where it was
        recorded before targets had times.
    id : what the controller calls it.
    tip_by_scale : with `machine: external`, 3 or 6 rows of n numbers, by how much each scale moves the tip, mm per mm,
        and turns what carries it, rad per mm.
    """

    tip_mm: tuple[float, ...]
    rotation_B0_rad: tuple[float, ...] | None = None
    valid_until_s: float = math.inf
    time_s: float = math.nan
    id: int | None = None
    tip_by_scale: tuple[tuple[float, ...], ...] | None = None


class Commands:
    """What the loop reads at the start of every cycle. Each has one writer, which replaces an immutable value.

    Machine zero and target are in shared memory: the service writes them, and the loop reads them in its process.
    """

    def __init__(self, zero: MachineZero | StateError, models: Models | None = None) -> None:
        #: those of a loop; None is the machine without effects. Other ones come with another loop process.
        self.models = models
        self._zero = SharedMessage()
        self._target = SharedMessage(_TARGET_BYTES)
        self.zero = zero

    def with_models(self, models: Models) -> Commands:
        """The same zero and target, for a loop with these models."""
        commands = copy(self)
        commands.models = models
        return commands

    @property
    def zero(self) -> MachineZero | StateError:
        """Machine zero, or why there is none. It is the same object until another one has been written."""
        zero: MachineZero | StateError = self._zero.read()
        return zero

    @zero.setter
    def zero(self, zero: MachineZero | StateError) -> None:
        self._zero.write(zero)

    @property
    def target(self) -> Target | None:
        """The controller's target; None is CMM mode."""
        target: Target | None = self._target.read()
        return target

    @target.setter
    def target(self, target: Target | None) -> None:
        self._target.write(target)
