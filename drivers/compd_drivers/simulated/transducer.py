"""A transducer in front of an analogue input: from what it measures to its signal, V or mA."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

BEYOND = 0.01  # of the range: how far a transducer goes beyond its calibrated ends before it saturates


def signal_for(linearisation: Any, value: float) -> float:
    """The signal at which the calibration curve has `value`; beyond its ends a little beyond; nan for nan."""
    if not math.isfinite(value):
        return math.nan
    if linearisation.table is not None:
        signals, values = np.array(linearisation.table).T
    else:
        signals = np.linspace(linearisation.valid[0], linearisation.valid[1], 4001)
        values = np.polynomial.Polynomial(linearisation.polynomial)(signals)
    if values[0] > values[-1]:
        signals, values = signals[::-1], values[::-1]
    beyond = BEYOND * (signals[-1] - signals[0])
    return float(np.interp(value, values, signals, left=signals[0] - beyond, right=signals[-1] + beyond))
