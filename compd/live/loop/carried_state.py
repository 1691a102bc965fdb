"""The state that a cycle hands to the next one, field by field: what the ring has of it, and what a recording keeps.

A state is carried without its models and the zero vectors, which follow from the inputs of its cycle. Of its machine
zero only this is carried: whether it is that of the cycle's inputs. A cycle uses nothing of another machine zero.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from compd.compensation import WarmStart
from compd.errors import StateError
from compd.live.loop.cycle_state import CycleState
from compd.live.loop.stale_policy import ComparatorSet
from compd.live.machine import MachineZero
from compd.model import EffectMemory
from compd.model.kinematics import Motion

_VECTOR = (-1,)
_MATRIX = (3, 3)


class CarriedField(NamedTuple):
    """One field of a class whose values are carried."""

    field: str  #: its name in the class
    name: str  #: in recordings; it stays as it is when the field is renamed
    shape: tuple[int, ...] | None = None  #: of an array of float64, as `reshape` takes it; None for any other value
    kind: type | None = None  #: the class of its value where that is carried field by field
    may_lack: bool = False  #: whether a recording leaves it out where it is None or empty


class CarriedKind(NamedTuple):
    """A class whose values are carried. tag : its name in recordings, which stays as it is when it is renamed."""

    tag: str
    fields: tuple[CarriedField, ...]


CARRIED: Mapping[type, CarriedKind] = {
    CycleState: CarriedKind(
        "Carried",
        (
            CarriedField("zero", "zero"),
            CarriedField("warm_start", "warm", kind=WarmStart),
            CarriedField("correction_mm", "correction_mm", _VECTOR),
            CarriedField("last_good", "last_good", kind=ComparatorSet),
            CarriedField("scales_seen", "scales_seen"),
            CarriedField("shadow_memory", "shadow", kind=EffectMemory),
            CarriedField("adopting", "adopting"),
            CarriedField("tip_noise_um", "tip_noise_um", _VECTOR),
            CarriedField("tip_correction_mm", "tip_correction_mm", _VECTOR),
            CarriedField("tip_by_gauge", "tip_by_gauge", (3, -1), may_lack=True),
        ),
    ),
    WarmStart: CarriedKind(
        "WarmStart",
        (
            CarriedField("supports_M_mm", "supports_M_mm", _MATRIX),
            CarriedField("origin_M_mm", "origin_M_mm", _VECTOR),
            CarriedField("rotation_M_P", "rotation_M_P", _MATRIX),
            CarriedField("effects", "effects", kind=EffectMemory),
            CarriedField("actuator_mm", "actuator_mm", _VECTOR, may_lack=True),
        ),
    ),
    ComparatorSet: CarriedKind(
        "Comparators",
        (
            CarriedField("change_mm", "change_mm", _VECTOR),
            CarriedField("time_s", "time_s"),
            CarriedField("oldest_s", "oldest_s"),
            CarriedField("quantities", "quantities"),
            CarriedField("group_times_s", "group_times_s", may_lack=True),
            CarriedField("length_times_s", "length_times_s", may_lack=True),
            CarriedField("drift_mm_per_s", "drift_mm_per_s", may_lack=True),
            CarriedField("scale_mm", "scale_mm", may_lack=True),
        ),
    ),
    EffectMemory: CarriedKind(
        "Remembered",
        (
            CarriedField("motion", "motion"),
            CarriedField("memories", "memories"),
            CarriedField("commanded", "commanded"),
        ),
    ),
    Motion: CarriedKind("Motion", tuple(CarriedField(field, field) for field in Motion._fields)),
}

_NO_MEMORY = EffectMemory()


class _Fields(NamedTuple):
    """How a record is packed: what gets all its fields, the indices of arrays, and index and class of those that are
    packed field by field."""

    get: Callable[[Any], tuple[Any, ...]]
    arrays: tuple[int, ...]
    parts: tuple[tuple[int, type], ...]


def pack_state(state: CycleState, zero: MachineZero | StateError) -> tuple[Any, ...]:
    """A state as plain values, for pickle: arrays as their bytes, which takes a tenth of the time that pickling them
    does. zero : of the inputs of its cycle."""
    return (state.zero is zero, *_pack_fields(CycleState, state)[1:])


def unpack_state(values: Sequence[Any], zero: MachineZero | StateError) -> CycleState:
    """The state in what `pack_state` returned, to the bit."""
    return with_zero_of(_unpack_fields(CycleState, values), zero)


def with_zero_of(state: CycleState, zero: MachineZero | StateError) -> CycleState:
    """A state that was carried, with the machine zero of its cycle in the place of whether it had that."""
    return state._replace(zero=zero if state.zero and isinstance(zero, MachineZero) else None)


def _pack_fields(kind: type, record: Any) -> tuple[Any, ...]:
    get, arrays, parts = _FIELDS[kind]
    values = [*get(record)]
    for index in arrays:
        if (value := values[index]) is not None:
            values[index] = value.tobytes()
    for index, part in parts:
        value = values[index]
        if part is EffectMemory:
            values[index] = None if value.is_empty else value
        elif value is not None:
            values[index] = _pack_fields(part, value)
    return tuple(values)


def _unpack_fields(kind: type, values: Sequence[Any]) -> Any:
    fields = CARRIED[kind].fields
    return kind(**{field.field: _unpack(field, value) for field, value in zip(fields, values, strict=True)})


def _unpack(field: CarriedField, value: Any) -> Any:
    if field.kind is EffectMemory:
        return value or _NO_MEMORY
    if value is None:
        return None
    if field.kind is not None:
        return _unpack_fields(field.kind, value)
    return value if field.shape is None else np.frombuffer(value, dtype=np.float64).reshape(field.shape)


def _fields_of(kind: type) -> _Fields:
    fields = CARRIED[kind].fields
    parts = tuple((index, field.kind) for index, field in enumerate(fields) if field.kind is not None)
    arrays = tuple(index for index, field in enumerate(fields) if field.shape is not None)
    return _Fields(attrgetter(*(field.field for field in fields)), arrays, parts)


_FIELDS: Mapping[type, _Fields] = {kind: _fields_of(kind) for kind in (CycleState, WarmStart, ComparatorSet)}
