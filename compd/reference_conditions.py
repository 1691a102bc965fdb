"""The conditions from which effects count: those at machine zero, or the standard ones."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, TypeAlias

from compd.errors import CompdError

# ISO 1: lengths are stated at 20 degC.
REFERENCE_TEMPERATURE_degC = 20.0
# ISO 2533 standard atmosphere: at this pressure interferometers' tables have their zero.
REFERENCE_PRESSURE_hPa = 1013.25

# From which conditions an effect counts, see `compd.model.effects.effect.Effect`.
Datum: TypeAlias = Literal["machine zero", "20 degC", "its own"]


def standard_value(quantity: str) -> float:
    """What a quantity is at standard conditions, by the unit in its name: 20 degC, 1013.25 hPa, 0 of anything else."""
    unit = quantity.rpartition("_")[2]
    return {"degC": REFERENCE_TEMPERATURE_degC, "hPa": REFERENCE_PRESSURE_hPa}.get(unit, 0.0)


def value_at_zero(quantity: str, at_zero: Mapping[str, float]) -> float:
    """What a quantity was at machine zero, of all that are known there.

    Raises CompdError where it was not measured then.
    """
    if quantity not in at_zero:
        raise CompdError.of(
            "rows for effects",
            "this quantity was not measured at machine zero, from where effects count",
            value=quantity,
            allowed=", ".join(sorted(at_zero)) or "nothing was",
            next_step="take machine zero again: `compd zero`; in a recording write it into its sidecar, under "
            "`quantities_at_zero:`",
        )
    return at_zero[quantity]
