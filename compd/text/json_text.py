"""JSON as the program writes it: on one line, and without NaN and infinity, for which JSON has no spelling."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

# One encoder for all calls: json.dumps() makes a new one whenever it is given separators.
_ENCODER = json.JSONEncoder(separators=(",", ":"), allow_nan=False, check_circular=False)


def encode_compact(value: Any) -> str:
    """`value` as JSON without spaces. Raises ValueError for NaN and infinity."""
    return _ENCODER.encode(value)


def nan_to_null(value: Any) -> Any:
    """A copy of plain data (dict, list, scalars) with None, JSON's null, for every float that is not finite.

    Subclasses of float, such as numpy.float64, become float. For reports, in which every key is always there.
    """
    if isinstance(value, dict):
        return {key: nan_to_null(part) for key, part in value.items()}
    if isinstance(value, list):
        return [nan_to_null(part) for part in value]
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return value


def omit_unknown(value: Any) -> Any:
    """A copy of plain data without the keys whose value is None or not finite; in lists these become None.

    Mappings become dicts with text keys, tuples lists. For messages, in which an absent key means "not known".
    """
    match value:
        case Mapping():
            pairs = ((str(key), omit_unknown(part)) for key, part in value.items())
            return {key: part for key, part in pairs if part is not None}
        case list() | tuple():
            return [omit_unknown(part) for part in value]
        case float() if not math.isfinite(value):
            return None
    return value
