"""Binary arrays for a browser: a line of JSON, then the raw numbers."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from compd.arrays import FloatArray


def packed(header: Mapping[str, Any], arrays: Mapping[str, FloatArray]) -> bytes:
    """A line of JSON, `header` with the name and shape of each array as `arrays`; then each as float32, little-endian.

    Numbers are in C order; nan where there is none.
    """
    shapes = [{"name": name, "shape": values.shape} for name, values in arrays.items()]
    line = json.dumps({**header, "arrays": shapes}).encode() + b"\n"
    return line + b"".join(values.astype("<f4").tobytes() for values in arrays.values())
