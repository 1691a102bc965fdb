"""Commands of clients to the loop: machine zero, target and models."""

from __future__ import annotations

import pickle
from dataclasses import dataclass

from compd.errors import StateError
from compd.live.loop.machine_zero import MachineZero
from compd.live.loop.model_loader import Models
from compd.live.memory.shared_record import SharedRecord

# Machine zero has some 60 bytes for each length gauge.
_ZERO_BYTES = 256 * 1024
_TARGET_BYTES = 1024


@dataclass(frozen=True)
class Target:
    """Where a controller wants the tip.

    tip_mm : (3), in {B0}; with the tool on the plate the place on the work, in {P}.
    rotation_B0_rad : (3), rotation vector of {P} in {B0}; None for the attitude at machine zero. The attitude of a
        tripod follows from its tip.
    """

    tip_mm: tuple[float, ...]
    rotation_B0_rad: tuple[float, ...] | None = None


class Commands:
    """What the loop reads at the start of every cycle. Each has one writer, which replaces an immutable value.

    Machine zero and target are in shared memory: the service writes them, and the loop reads them in its process.

    Attributes
    ----------
    models : those of this process; None is the machine without effects. Other ones come with another loop process.
    """

    def __init__(self, zero: MachineZero | StateError, models: Models | None = None) -> None:
        self.models = models
        self._zero_record = SharedRecord(_ZERO_BYTES)
        self._target_record = SharedRecord(_TARGET_BYTES)
        self._zero, self._zero_version = zero, 0
        self._target: Target | None = None
        self._target_version = 0
        self.zero = zero

    @property
    def zero(self) -> MachineZero | StateError:
        """Machine zero, or why there is none. It is the same object until another one has been written."""
        if (version := self._zero_record.version) != self._zero_version and (content := self._zero_record.read()):
            fields = pickle.loads(content)
            self._zero = MachineZero(**fields) if isinstance(fields, dict) else StateError(fields)
            self._zero_version = version
        return self._zero

    @zero.setter
    def zero(self, zero: MachineZero | StateError) -> None:
        fields = zero.to_json() if isinstance(zero, MachineZero) else zero.problems
        self._zero_record.write(pickle.dumps(fields))
        self._zero, self._zero_version = zero, self._zero_record.version

    @property
    def target(self) -> Target | None:
        """The controller's target; None is CMM mode."""
        if (version := self._target_record.version) != self._target_version and (content := self._target_record.read()):
            self._target, self._target_version = pickle.loads(content), version
        return self._target

    @target.setter
    def target(self, target: Target | None) -> None:
        self._target_record.write(pickle.dumps(target))
        self._target, self._target_version = target, self._target_record.version
