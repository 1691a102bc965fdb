"""What a cycle carries over, as plain data for JSON and back, without losing a bit.

Arrays go as base64 of their bytes: nan included, which JSON's numbers have no word for, and cheaper than decimals.
Everything says what it is, so that a state which grows is written without a change here.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from compd.compensation import WarmStart
from compd.live.loop.cycle_state import CycleState
from compd.live.loop.stale_policy import ComparatorSet
from compd.model.apply_effects import EffectMemory
from compd.model.motion import Motion

# Tags in recordings: they stay as they are, whatever the classes are called.
_KINDS: Mapping[str, Any] = {
    "Carried": CycleState,
    "WarmStart": WarmStart,
    "Comparators": ComparatorSet,
    "Remembered": EffectMemory,
    "Motion": Motion,
}
_TAGS: Mapping[type, str] = {kind: tag for tag, kind in _KINDS.items()}


def to_plain(value: Any) -> Any:
    """Named tuples, tuples, mappings by text, arrays, numbers, texts, None. TypeError for anything else."""
    match value:
        case np.ndarray() | np.generic():
            array = np.asarray(value, order="C")
            return {
                "array": base64.b64encode(array.tobytes()).decode(),
                "type": array.dtype.str,
                "shape": list(array.shape),
            }
        case tuple() if hasattr(value, "_fields"):
            fields = {name: to_plain(part) for name, part in zip(value._fields, value, strict=True)}
            return {"kind": _TAGS[type(value)], **fields}
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
    """What `to_plain` was given. Raises KeyError, TypeError or ValueError for what it cannot have made."""
    match data:
        case {"array": text, "type": dtype, "shape": shape}:
            return np.frombuffer(base64.b64decode(text), dtype=dtype).reshape(shape)
        case {"kind": name, **fields}:
            return _KINDS[name](**{str(key): from_plain(part) for key, part in fields.items()})
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
