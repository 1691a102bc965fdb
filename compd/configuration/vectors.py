"""Vectors of a configuration: three finite numbers, and unit vectors."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import AfterValidator

from compd.documents import Finite

Vector = tuple[Finite, Finite, Finite]


def _unit_vector(vector: Vector) -> Vector:
    """The vector itself; ValueError unless its length is 1."""
    length = math.hypot(*vector)
    if not math.isclose(length, 1.0, abs_tol=1e-6):
        raise ValueError(f"must have length 1, has {length:.9g}")
    return vector


Direction = Annotated[Vector, AfterValidator(_unit_vector)]
