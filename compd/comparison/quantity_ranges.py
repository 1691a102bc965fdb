"""Between which values the quantities were that fitted effects read: beyond them, a fit is extrapolated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np

from compd.arrays import BoolArray
from compd.model.effects import FittedEffect, Observations, needed_quantities

# Lowest and highest value of each quantity, by its name.
Ranges: TypeAlias = Mapping[str, tuple[float, float]]


def quantity_ranges(fitted: Sequence[FittedEffect], rows: Observations, used: BoolArray) -> Ranges:
    """Of each quantity that the effects read, in the rows `used` (N,); without those that have no value there."""
    ranges: dict[str, tuple[float, float]] = {}
    for effect in fitted:
        for name in needed_quantities(effect.effect, rows.links):
            values = rows.quantities[name][used] if name in rows.quantities else np.array([])
            if np.isfinite(values).any():
                ranges[name] = float(np.nanmin(values)), float(np.nanmax(values))
    return ranges
