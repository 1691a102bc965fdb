"""From a sensor's signal (V, mA) to its quantity: a table or a polynomial from its calibration.

    linearisation: {signal: V, table: [[-10, -1.0], [0, 0.002], [10, 1.0]]}
    linearisation: {signal: mA, polynomial: [-1.25, 0.0625], valid: [4, 20]}       # -1.25 + 0.0625 x, at 20 mA 0

The result is in the channel's unit. Beyond the table's ends, or beyond `valid`, there is no value: nothing is
extrapolated. A live zero (4 to 20 mA) that falls below 3.6 mA or rises above 21 mA says that the sensor is broken
(NAMUR NE 43); that holds for every mA signal whose range begins at 3.6 mA or above.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from compd.gauge import Quality, Reading, bad, good

# Limits (mA) of NAMUR NE 43: outside them a 4-20 mA transmitter reports its own failure, or its wire is broken.
FAILURE_LOW_mA = 3.6
FAILURE_HIGH_mA = 21.0

Finite = Annotated[float, Field(allow_inf_nan=False)]


class Linearisation(BaseModel):
    """A calibration curve: exactly one of `table` and `polynomial`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    signal: Literal["V", "mA"] = Field(description="the sensor's signal")
    table: tuple[tuple[Finite, Finite], ...] | None = Field(
        default=None, min_length=2, description="[signal, value] pairs, signals rising; straight lines between them"
    )
    polynomial: tuple[Finite, ...] | None = Field(
        default=None, min_length=2, description="c0, c1, c2 ...: value = c0 + c1 signal + c2 signal^2 ..."
    )
    valid: tuple[Finite, Finite] | None = Field(
        default=None, description="[lowest, highest] signal for which the polynomial was calibrated"
    )

    @model_validator(mode="after")
    def _one_curve(self) -> Self:
        if (self.table is None) == (self.polynomial is None):
            raise ValueError("needs either `table` or `polynomial`")
        if (self.polynomial is None) != (self.valid is None):
            raise ValueError("`valid` belongs to a polynomial, and every polynomial needs it")
        if self.table is not None:
            signals, values = zip(*self.table, strict=True)
            steps = np.diff(values)
            if not np.all(np.diff(signals) > 0):
                raise ValueError("the table's signals must rise from pair to pair")
            if not (np.all(steps > 0) or np.all(steps < 0)):
                raise ValueError("the table's values must all rise or all fall")
        if self.polynomial is not None and self.valid is not None:
            self._check_polynomial(self.polynomial, self.valid)
        return self

    @staticmethod
    def _check_polynomial(polynomial: tuple[float, ...], valid: tuple[float, float]) -> None:
        low, high = valid
        if low >= high:
            raise ValueError("`valid` is [lowest, highest]")
        slope = np.polynomial.Polynomial(polynomial).deriv()
        turns = [
            root
            for root in np.asarray(slope.roots(), dtype=complex)
            if abs(root.imag) < 1e-9 and low < root.real < high
        ]
        if turns or not np.any(slope.coef):
            raise ValueError("the polynomial must rise or fall all through `valid`")

    @property
    def ends(self) -> tuple[float, float]:
        """Lowest and highest signal with a value."""
        if self.table is not None:
            return self.table[0][0], self.table[-1][0]
        assert self.valid is not None  # ensured by the validator
        return self.valid

    def reading(self, signal: float, time_s: float) -> Reading:
        """The reading in the channel's unit; OVER_RANGE and UNDER_RANGE speak of the signal."""
        low, high = self.ends
        text = f"{signal:g} {self.signal}"
        if not math.isfinite(signal):
            return bad(time_s, Quality.NOT_FINITE, text)
        if self.signal == "mA" and low >= FAILURE_LOW_mA and not FAILURE_LOW_mA <= signal <= FAILURE_HIGH_mA:
            return bad(time_s, Quality.SENSOR_FAULT, f"{text}: broken wire or failed sensor")
        if signal < low:
            return bad(time_s, Quality.UNDER_RANGE, text)
        if signal > high:
            return bad(time_s, Quality.OVER_RANGE, text)
        return good(self._value(signal), time_s)

    def _value(self, signal: float) -> float:
        if self.polynomial is not None:
            value = 0.0
            for coefficient in reversed(self.polynomial):
                value = value * signal + coefficient
            return value
        assert self.table is not None  # ensured by the validator
        after = min(bisect_right(self.table, signal, key=lambda pair: pair[0]), len(self.table) - 1)
        (x0, y0), (x1, y1) = self.table[after - 1 : after + 1]
        return y0 + (y1 - y0) * (signal - x0) / (x1 - x0)
