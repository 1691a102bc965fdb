"""A place that is to be measured: for the instrument's target list, and for the controller that drives there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from compd.arrays import FloatArray


@dataclass(frozen=True)
class Way:
    """How the tip comes to a place so that every link comes from the side that is wanted.

    via_M_mm : (3,) where it begins. end_M_mm : (3,) where it ends; None if it ends at the place, at rest.
    speed_mm_per_s : of the tip on the way; 0 where any will do.
    """

    via_M_mm: FloatArray
    end_M_mm: FloatArray | None = None
    speed_mm_per_s: float = 0.0


@dataclass(frozen=True)
class TargetPoint:
    """One row of a plan."""

    name: str  #: unique in the plan, "P007"
    purpose: str  #: what it is for
    tip_M_mm: FloatArray | None  #: (3,) place of the tool's tip in {M}; None if the plan sets something else
    #: (3,) turn of the platform since machine zero, a rotation vector in {M}; None where it stays as there
    turn_rad: FloatArray | None = None
    #: what is to be set or held, by name with unit, in the order in which it is shown
    settings: Mapping[str, float] = field(default_factory=dict)
    begins: bool = True  #: whether it begins a programme
    time_s: float = 0.0  #: after the programme's beginning
    way: Way | None = None  #: None if the tip may come as it likes, or where no straight way is as wanted
    no_way: str = ""  #: why there is no such way; "" if there is one, or none is wanted
