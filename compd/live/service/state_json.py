"""The state that a cycle hands to the next one, as plain data for JSON, and back bit for bit.

An array becomes the base64 text of its bytes, with its type and shape: so nan, which JSON has no number for, is kept,
and writing it takes less time than decimals. A named tuple carries a tag that says what it is.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from compd.compensation import WarmStart
from compd.live.loop import ComparatorSet, CycleState
from compd.model import EffectMemory
from compd.model.kinematics import Motion

# The tags are part of the recordings' format: they stay as they are when a class is renamed.
_KINDS: Mapping[str, Any] = {
    "Carried": CycleState,
    "WarmStart": WarmStart,
    "Comparators": ComparatorSet,
    "Remembered": EffectMemory,
    "Motion": Motion,
}
_TAGS: Mapping[type, str] = {kind: tag for tag, kind in _KINDS.items()}
# What recordings call that have the tip's standard uncertainty in their setpoints, and not the bound of its error.
FORMER_TIP_NOISE = "u_tip_um"
# Names of the fields in recordings, and in the class; fields that are not listed are not written. The other classes
# have the same names in both.
_CYCLE_STATE_FIELDS: Mapping[str, str] = {
    "zero": "zero",
    "warm": "warm_start",
    "correction_mm": "correction_mm",
    "last_good": "last_good",
    "scales_seen": "scales_seen",
    "shadow": "shadow_memory",
    "adopting": "adopting",
    "tip_noise_um": "tip_noise_um",
    "tip_correction_mm": "tip_correction_mm",
    "tip_by_gauge": "tip_by_gauge",
}
_MEMORY_FIELDS = ("motion", "memories", "commanded")

# Of a set of comparators: not written where they are empty.
_MAY_BE_EMPTY = ("group_times_s", "length_times_s", "drift_mm_per_s", "scale_mm")


def to_plain(value: Any) -> Any:
    """`value` as lists, dictionaries, numbers and texts.

    It may be made of named tuples (those with a tag), tuples, mappings by text, arrays, numbers, texts and None. Raises
    TypeError for anything else.
    """
    match value:
        case np.ndarray() | np.generic():
            array = np.asarray(value, order="C")
            return {
                "array": base64.b64encode(array.tobytes()).decode(),
                "type": array.dtype.str,
                "shape": list(array.shape),
            }
        case tuple() if hasattr(value, "_fields"):
            names = _CYCLE_STATE_FIELDS if isinstance(value, CycleState) else {name: name for name in value._fields}
            if isinstance(value, CycleState) and value.tip_by_gauge is None:
                names = {name: field for name, field in names.items() if name != "tip_by_gauge"}
            if isinstance(value, ComparatorSet):
                names = {name: name for name in names if name not in _MAY_BE_EMPTY or getattr(value, name)}
            fields = {name: to_plain(getattr(value, field)) for name, field in names.items()}
            return {"kind": _TAGS[type(value)], **fields}
        case EffectMemory():
            return {"kind": _TAGS[EffectMemory], **{name: to_plain(getattr(value, name)) for name in _MEMORY_FIELDS}}
        case tuple():
            return [to_plain(part) for part in value]
        case Mapping():
            return {"mapping": {name: to_plain(part) for name, part in value.items()}}
        case None:
            return {}
        case float() if not math.isfinite(value):
            return {"float": str(value)}
        case bool() | int() | float() | str():
            return value
    raise TypeError(f"{type(value).__name__} cannot be carried in a READINGS message")


def from_plain(data: Any) -> Any:
    """The inverse of `to_plain`. Raises KeyError, TypeError or ValueError for data that it cannot have made."""
    match data:
        case {"array": text, "type": dtype, "shape": shape}:
            return np.frombuffer(base64.b64decode(text), dtype=dtype).reshape(shape)
        case {"kind": tag, **fields}:
            kind = _KINDS[tag]
            fields_of = _MEMORY_FIELDS if kind is EffectMemory else kind._fields
            names = {name: name for name in fields_of}
            if kind is CycleState:
                names = {**_CYCLE_STATE_FIELDS, FORMER_TIP_NOISE: "tip_noise_um"}
            return kind(**{names[str(name)]: from_plain(part) for name, part in fields.items()})
        case {"mapping": items}:
            return {name: from_plain(part) for name, part in items.items()}
        case {"float": text}:
            return float(text)
        case list():
            return tuple(from_plain(part) for part in data)
        case {}:
            if data:
                raise ValueError(f"no such state: {sorted(data)}")
            return None
    return data
