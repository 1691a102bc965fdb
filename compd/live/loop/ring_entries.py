"""What the loop sends through the second of its rings: all that a setpoint was computed from.

The setpoint itself goes first, through a ring of its own, since clients wait for it (`Setpoint.pack`). The cycle
follows: READINGS messages are made of it, and a loop that takes over computes the last one once more, to have the state
that it left.
"""

from __future__ import annotations

import pickle
from collections.abc import Sequence
from typing import NamedTuple

from compd.errors import StateError
from compd.gauge import Quality
from compd.live.loop.carried_state import pack_state, unpack_state
from compd.live.loop.cycle_state import CycleInputs, CycleState
from compd.live.loop.setpoint import Setpoint
from compd.live.machine import MachineZero, ModelNames, Models, Wire
from compd.live.memory import Readings, Snapshot
from compd.travel_direction import Travel, advance


class Directions:
    """Direction of travel of each link from its scale; a sink of the loop.

    A recording of a few rows per second would miss a link that goes out and comes back between two rows.
    """

    def __init__(self, scales: Sequence[Wire]) -> None:
        self._wires = tuple((wire.slot, wire.sign) for wire in scales)
        self._travels = [Travel()] * len(self._wires)

    @property
    def now(self) -> list[int]:
        """(n,) +1 or -1; 0 before the link has moved."""
        return [int(travel.direction) for travel in self._travels]

    def update(self, setpoint: Setpoint) -> None:
        """Take the good readings of one cycle."""
        assert setpoint.inputs is not None
        readings = setpoint.inputs.snapshot.readings
        for link, (slot, sign) in enumerate(self._wires):
            value, _, quality, *_ = readings[slot]
            if quality is Quality.OK:
                self._travels[link] = advance(self._travels[link], sign * value)


_PICKLE_PROTOCOL = 5
NO_MODELS = ModelNames({}, {})


class SentCycle(NamedTuple):
    """One cycle, in another process than the one that computed it."""

    inputs: CycleInputs  #: without the models
    state_before: CycleState  #: from which it was computed, without the models
    setpoint_line: bytes  #: the SETPOINT line that it made
    models: ModelNames = NO_MODELS  #: which models it was computed with
    approach: tuple[int, ...] = ()  #: (n) direction in which each link last moved


class CyclePacker:
    """Packs cycles as entries of the ring, in the loop's process."""

    def __init__(self, directions: Directions) -> None:
        """`directions`: follows the links in every cycle."""
        self._directions = directions
        self._zero: MachineZero | StateError | None = None
        self._models: Models | None = None
        self._zero_bytes = b""
        self._names = NO_MODELS

    def pack(self, setpoint: Setpoint, line: bytes) -> bytes:
        """The newest cycle as the content of an entry; called with each of a run, since the directions follow them."""
        inputs, state = setpoint.inputs, setpoint.state_before
        assert inputs is not None, "every setpoint of a cycle has its inputs"
        assert state is not None, "and its state"
        self._directions.update(setpoint)
        if inputs.zero is not self._zero:  # it has kilobytes, and is the same for days
            self._zero = inputs.zero
            self._zero_bytes = pickle.dumps(inputs.zero)
        if inputs.models is not self._models:
            self._models = inputs.models
            self._names = NO_MODELS if inputs.models is None else inputs.models.names
        return pickle.dumps(
            (
                (inputs.tick, inputs.snapshot.time_s, inputs.snapshot.readings.image, self._zero_bytes),
                (inputs.target, inputs.ending),
                pack_state(state, inputs.zero),
                line,
                tuple(self._names),
                tuple(self._directions.now),
            ),
            _PICKLE_PROTOCOL,
        )


class CycleUnpacker:
    """Unpacks cycles. The same machine zero is the same object as long as it does not change."""

    def __init__(self) -> None:
        self._zero: MachineZero | StateError | None = None
        self._zero_bytes = b""

    def unpack(self, content: bytes) -> SentCycle:
        """The cycle in an entry's content."""
        readings, commands, state, line, names, approach = pickle.loads(content)
        tick, time_s, image, zero_bytes = readings
        if zero_bytes != self._zero_bytes or self._zero is None:
            self._zero = pickle.loads(zero_bytes)
            self._zero_bytes = zero_bytes
        target, ending = commands
        inputs = CycleInputs(tick, Snapshot(time_s, Readings.checked(image)), self._zero, target, None, ending)
        return SentCycle(inputs, unpack_state(state, self._zero), line, ModelNames(*names), approach)
