"""The state that a cycle hands to the next one, as plain data for JSON, and back bit for bit.

An array becomes the base64 text of its bytes, with its type and shape: so nan, which JSON has no number for, is kept,
and writing it takes less time than decimals. A value of a class of CARRIED has a tag that says what it is.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from compd.live.loop import CARRIED, CycleState

_KINDS: Mapping[str, type] = {carried.tag: kind for kind, carried in CARRIED.items()}
# What recordings call that have the tip's standard uncertainty in their setpoints, and not the bound of its error.
FORMER_TIP_NOISE = "u_tip_um"


def to_plain(value: Any) -> Any:
    """`value` as lists, dictionaries, numbers and texts.

    It may be made of values of the classes in CARRIED, tuples, mappings by text, arrays, numbers, texts and None.
    Raises TypeError for anything else.
    """
    match value:
        case np.ndarray() | np.generic():
            array = np.asarray(value, order="C")
            return {
                "array": base64.b64encode(array.tobytes()).decode(),
                "type": array.dtype.str,
                "shape": list(array.shape),
            }
        case _ if (carried := CARRIED.get(type(value))) is not None:
            parts = ((field, getattr(value, field.field)) for field in carried.fields)
            fields = {field.name: to_plain(part) for field, part in parts if not (field.may_lack and _is_absent(part))}
            return {"kind": carried.tag, **fields}
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
            names = {field.name: field.field for field in CARRIED[kind].fields}
            if kind is CycleState:
                names[FORMER_TIP_NOISE] = "tip_noise_um"
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


def _is_absent(value: Any) -> bool:
    return value is None or (isinstance(value, tuple) and not value)
