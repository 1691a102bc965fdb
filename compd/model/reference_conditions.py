"""The conditions from which effects count: those at machine zero, or the standard ones."""

from __future__ import annotations

from typing import Literal, TypeAlias

# ISO 1: lengths are stated at 20 degC.
REFERENCE_TEMPERATURE_degC = 20.0
# ISO 2533 standard atmosphere: at this pressure interferometers' tables have their zero.
REFERENCE_PRESSURE_hPa = 1013.25

# From which conditions an effect counts, see `compd.model.effect.Effect`.
Datum: TypeAlias = Literal["machine zero", "20 degC", "its own"]


def standard_value(quantity: str) -> float:
    """What a quantity is at standard conditions, by the unit in its name: 20 degC, 1013.25 hPa, 0 of anything else."""
    unit = quantity.rpartition("_")[2]
    return {"degC": REFERENCE_TEMPERATURE_degC, "hPa": REFERENCE_PRESSURE_hPa}.get(unit, 0.0)
