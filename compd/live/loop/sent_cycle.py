"""A cycle as it goes through the ring: its setpoint, and all that it was computed from.

So each entry of the ring stands on its own: the service makes SETPOINT and READINGS messages of it, and a loop that
takes over computes its last cycle once more to have the state that this one left.
"""

from __future__ import annotations

import pickle
from typing import NamedTuple

from compd.errors import StateError
from compd.live.loop.cycle_state import CycleInputs
from compd.live.loop.directions import Directions
from compd.live.loop.machine_zero import MachineZero
from compd.live.loop.model_loader import ModelNames, Models
from compd.live.loop.setpoint import Setpoint
from compd.live.memory.latest import Latest, Snapshot, unpack_readings

_PICKLE_PROTOCOL = 5


class SentCycle(NamedTuple):
    """One cycle, in another process than the one that computed it.

    Attributes
    ----------
    setpoint : with its inputs and the state before it, but without the models in both. A setpoint that the service
        makes by itself, since the loop makes none, has neither.
    models : which models it was computed with.
    approach : (n) direction in which each link last moved.
    """

    setpoint: Setpoint
    models: ModelNames = ModelNames({}, {})
    approach: tuple[int, ...] = ()


class CycleEncoder:
    """Turns setpoints into entries of the ring, in the loop's process."""

    def __init__(self, latest: Latest, directions: Directions) -> None:
        """`latest`: of which the cycle took its snapshot; `directions`: follows the links in every cycle."""
        self._latest = latest
        self._directions = directions
        self._zero: MachineZero | StateError | None = None
        self._models: Models | None = None
        self._zero_bytes = b""
        self._names = ModelNames({}, {})

    def encode(self, setpoint: Setpoint) -> bytes:
        """The entry of the newest setpoint; called with each of a run, since the directions follow them."""
        inputs, state = setpoint.inputs, setpoint.state_before
        assert inputs is not None, "every setpoint of a cycle has its inputs"
        assert state is not None, "and its state"
        self._directions.update(setpoint)
        if inputs.zero is not self._zero:  # it has kilobytes, and is the same for days
            self._zero = inputs.zero
            self._zero_bytes = pickle.dumps(
                inputs.zero.to_json() if isinstance(inputs.zero, MachineZero) else inputs.zero.problems
            )
        if inputs.models is not self._models:
            self._models = inputs.models
            self._names = ModelNames({}, {}) if inputs.models is None else inputs.models.names
        carried = state._replace(zero=None, zero_vectors=None, models=None)
        return pickle.dumps(
            (
                tuple(setpoint[:9]),
                self._latest.image,
                self._zero_bytes,
                inputs.target,
                inputs.ending,
                carried,
                state.zero is inputs.zero,
                tuple(self._names),
                tuple(self._directions.now),
            ),
            _PICKLE_PROTOCOL,
        )


class CycleDecoder:
    """Turns entries of the ring into cycles. The same machine zero is the same object as long as it does not change."""

    def __init__(self) -> None:
        self._zero: MachineZero | StateError | None = None
        self._zero_bytes = b""

    def decode(self, content: bytes) -> SentCycle:
        """The cycle in an entry's content."""
        fields, image, zero_bytes, target, ending, state, same_zero, names, approach = pickle.loads(content)
        if zero_bytes != self._zero_bytes:
            zero = pickle.loads(zero_bytes)
            self._zero = MachineZero(**zero) if isinstance(zero, dict) else StateError(zero)
            self._zero_bytes = zero_bytes
        assert self._zero is not None
        setpoint = Setpoint(*fields)
        snapshot = Snapshot(setpoint.time_s, unpack_readings(image))
        inputs = CycleInputs(setpoint.seq, snapshot, self._zero, target, None, ending)
        if same_zero and isinstance(self._zero, MachineZero):
            state = state._replace(zero=self._zero)
        return SentCycle(setpoint._replace(inputs=inputs, state_before=state), ModelNames(*names), approach)
