"""What the loop sends through its two rings: each setpoint as it goes to clients, then all that it was computed from.

The setpoint goes first, since clients wait for it. The cycle follows: READINGS messages are made of it, and a loop that
takes over computes the last one once more, to have the state that it left.
"""

from __future__ import annotations

import pickle
from typing import Any, NamedTuple, Self

import numpy as np

from compd.arrays import FloatArray
from compd.compensation import WarmStart
from compd.errors import StateError
from compd.live.loop.cycle_state import CycleInputs, CycleState
from compd.live.loop.directions import Directions
from compd.live.loop.machine_zero import MachineZero
from compd.live.loop.model_loader import ModelNames, Models
from compd.live.loop.setpoint import Setpoint
from compd.live.loop.stale_policy import ComparatorSet
from compd.live.memory import Readings, Snapshot
from compd.model import EffectMemory
from compd.setpoint_states import Mode, State

_PICKLE_PROTOCOL = 5
NO_MODELS = ModelNames({}, {})
_NO_MEMORY = EffectMemory()


class SentSetpoint(NamedTuple):
    """A setpoint in the forms in which it is sent.

    Attributes
    ----------
    seq, time_s, state, reason, mode : of the setpoint.
    line : its JSON, with the newline. packet : for UDP; b"" where that is not configured.
    """

    seq: int
    time_s: float
    state: State
    reason: str
    mode: Mode
    line: bytes
    packet: bytes = b""

    @classmethod
    def of(cls, setpoint: Setpoint, config_hash: bytes | None) -> Self:
        """config_hash : for the packet; None where UDP is not configured."""
        packet = b"" if config_hash is None else setpoint.to_packet(config_hash)
        line = setpoint.to_json()
        return cls(setpoint.seq, setpoint.time_s, setpoint.state, setpoint.reason, setpoint.mode, line, packet)

    def pack(self) -> bytes:
        """As the content of an entry."""
        return pickle.dumps(
            (self.seq, self.time_s, self.state.code, self.reason, self.mode.code, self.line, self.packet),
            _PICKLE_PROTOCOL,
        )

    @classmethod
    def unpack(cls, content: bytes) -> Self:
        """From the content of an entry."""
        seq, time_s, state, reason, mode, line, packet = pickle.loads(content)
        return cls(seq, time_s, _STATES[state], reason, _MODES[mode], line, packet)


_STATES = {state.code: state for state in State}
_MODES = {mode.code: mode for mode in Mode}


class SentCycle(NamedTuple):
    """One cycle, in another process than the one that computed it.

    Attributes
    ----------
    inputs : without the models.
    state_before : from which it was computed, without the models.
    setpoint_line : the SETPOINT line that it made.
    models : which models it was computed with.
    approach : (n) direction in which each link last moved.
    """

    inputs: CycleInputs
    state_before: CycleState
    setpoint_line: bytes
    models: ModelNames = NO_MODELS
    approach: tuple[int, ...] = ()


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
                (_state_fields(state), state.zero is inputs.zero),
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
        readings, commands, (fields, has_zero), line, names, approach = pickle.loads(content)
        tick, time_s, image, zero_bytes = readings
        if zero_bytes != self._zero_bytes or self._zero is None:
            self._zero = pickle.loads(zero_bytes)
            self._zero_bytes = zero_bytes
        target, ending = commands
        inputs = CycleInputs(tick, Snapshot(time_s, Readings.checked(image)), self._zero, target, None, ending)
        zero = self._zero if has_zero and isinstance(self._zero, MachineZero) else None
        return SentCycle(inputs, _state(fields, zero), line, ModelNames(*names), approach)


def _state_fields(state: CycleState) -> tuple[Any, ...]:
    """A state as plain values: arrays as their bytes, which takes a tenth of the time that pickling them does."""
    supports_M_mm, origin_M_mm, rotation_M_P, effects = state.warm_start
    last_good, tip_noise_um, tip_correction_mm = state.last_good, state.tip_noise_um, state.tip_correction_mm
    tip_by_gauge = state.tip_by_gauge
    return (
        (supports_M_mm.tobytes(), origin_M_mm.tobytes(), rotation_M_P.tobytes()),
        None if effects.is_empty else effects,
        state.correction_mm.tobytes(),
        None
        if last_good is None
        else (last_good.change_mm.tobytes(), *last_good[1:3], dict(last_good.quantities), *last_good[4:]),
        state.scales_seen,
        None if state.shadow_memory.is_empty else state.shadow_memory,
        state.adopting,
        None if tip_noise_um is None else tip_noise_um.tobytes(),
        None if tip_correction_mm is None else tip_correction_mm.tobytes(),
        None if tip_by_gauge is None else tip_by_gauge.tobytes(),
    )


def _state(fields: tuple[Any, ...], zero: MachineZero | None) -> CycleState:
    """The state in the fields, to the bit; without what follows from the inputs of its cycle."""
    (supports, origin, rotation), effects, correction, last_good, scales_seen, shadow_memory, adopting, *rest = fields
    tip_noise, tip, tip_by_gauge = rest
    return CycleState(
        zero,
        WarmStart(
            _array(supports).reshape(3, 3), _array(origin), _array(rotation).reshape(3, 3), effects or _NO_MEMORY
        ),
        _array(correction),
        None if last_good is None else ComparatorSet(_array(last_good[0]), *last_good[1:]),
        scales_seen,
        shadow_memory or _NO_MEMORY,
        adopting,
        None if tip_noise is None else _array(tip_noise),
        None if tip is None else _array(tip),
        tip_by_gauge=None if tip_by_gauge is None else _array(tip_by_gauge).reshape(3, -1),
    )


def _array(content: bytes) -> FloatArray:
    return np.frombuffer(content, dtype=np.float64)
