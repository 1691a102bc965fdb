"""Common options of described channels: name, unit on the wire, valid numbers.

One key `unit` says what the device sends; the channel delivers mm, degC, N, hPa, pct or 1.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Annotated, Literal, NamedTuple, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from compd.gauge import Channel, OptionDoubt, Quality, Reading, Unit, bad, good, stands_for_no_number
from compd_drivers.linearisation import Linearisation
from compd_drivers.no_number import range_doubts, unless_missing

Finite = Annotated[float, Field(allow_inf_nan=False)]
WireUnit = Literal[
    "mm", "um", "nm", "inch", "mil", "degC", "degF", "K", "N", "kN", "hPa", "mbar", "kPa", "Pa", "pct", "1", "V", "mA"
]
# Qualities that a device may send in place of a number.
ReplyQuality = Literal["sensor_fault", "device_error", "over_range", "under_range", "silent"]


class _Conversion(NamedTuple):
    """value = wire x factor + offset, in `unit`."""

    unit: Unit
    factor: float = 1.0
    offset: float = 0.0


# Exact by definition: 1 inch = 25.4 mm, 0 degC = 273.15 K = 32 degF, 1 mbar = 1 hPa.
CONVERSIONS: Mapping[str, _Conversion] = {
    "mm": _Conversion("mm"),
    "um": _Conversion("mm", 1e-3),
    "nm": _Conversion("mm", 1e-6),
    "inch": _Conversion("mm", 25.4),
    "mil": _Conversion("mm", 0.0254),
    "degC": _Conversion("degC"),
    "degF": _Conversion("degC", 5 / 9, -160 / 9),
    "K": _Conversion("degC", 1.0, -273.15),
    "N": _Conversion("N"),
    "kN": _Conversion("N", 1e3),
    "hPa": _Conversion("hPa"),
    "mbar": _Conversion("hPa"),
    "kPa": _Conversion("hPa", 10.0),
    "Pa": _Conversion("hPa", 1e-2),
    "pct": _Conversion("pct"),
    "1": _Conversion("1"),
}
SIGNALS = ("V", "mA")


RANGE_OPTION = "range"
RANGE = f"`{RANGE_OPTION}`"
# Smallest (besides 0) and largest plausible float; floats with exchanged bytes lie outside.
MIN_FLOAT, MAX_FLOAT = 1e-20, 1e20


def not_measured(number: float) -> bool:
    """Whether a float on the wire is implausible, and probably read in a wrong order of its bytes."""
    return math.isfinite(number) and number != 0.0 and not MIN_FLOAT <= abs(number) <= MAX_FLOAT


class DescriptionSection(BaseModel):
    """A part of a description: unknown keys are refused, values are immutable."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class MeasuredChannel(DescriptionSection):
    """One number sent by a device."""

    name: str = Field(pattern=r"^[A-Za-z0-9_]+$", description="name of the channel")
    unit: WireUnit = Field(description="of the number on the wire, after `scale`; V and mA need a linearisation")
    scale: Finite = Field(default=1.0, description="unit per number on the wire; negative turns the sign")
    range: tuple[Finite, Finite] | None = Field(
        default=None, description="[lowest, highest] value that the sensor can deliver, in the channel's unit (mm ...)"
    )
    linearisation: Linearisation | None = Field(default=None, description="from V or mA to `measures`")
    measures: Unit = Field(default="mm", description="unit behind the linearisation")

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.scale == 0:
            raise ValueError("`scale` must not be 0")
        if self.range is not None and self.range[0] >= self.range[1]:
            raise ValueError("`range` is [lowest, highest]")
        if (self.unit in SIGNALS) != (self.linearisation is not None):
            raise ValueError("units V and mA need a `linearisation`, and only they have one")
        if self.linearisation is not None and self.linearisation.signal != self.unit:
            raise ValueError(f"the linearisation begins with {self.linearisation.signal}, the device sends {self.unit}")
        return self

    @property
    def channel(self) -> Channel:
        """The gauge's channel."""
        return Channel(self.name, self.measures if self.linearisation else CONVERSIONS[self.unit].unit)

    @property
    def states_range(self) -> bool:
        """Whether the values are limited by a range, or by the ends of the linearisation."""
        return self.range is not None or self.linearisation is not None

    def reading(
        self, number: float, time_s: float, raw: float | None = None, full_scale: Collection[float] = ()
    ) -> Reading:
        """The reading for a number from the wire.

        raw : the number as it was sent, where that is another. full_scale : the full-scale words of its type.
        """
        if stands_for_no_number(number):
            return bad(time_s, Quality.NOT_FINITE, f"{number:g} stands for no number")
        scaled = number * self.scale
        if self.linearisation is not None:
            reading = self.linearisation.reading(scaled, time_s)
        else:
            conversion = CONVERSIONS[self.unit]
            reading = good(scaled * conversion.factor + conversion.offset, time_s)
        if reading.ok and self.range is not None:
            if reading.value < self.range[0]:
                return bad(time_s, Quality.UNDER_RANGE, f"{reading.value:g} {self.channel.unit}")
            if reading.value > self.range[1]:
                return bad(time_s, Quality.OVER_RANGE, f"{reading.value:g} {self.channel.unit}")
        if self.states_range:
            return reading
        return unless_missing(reading, number if raw is None else raw, full_scale, RANGE)


def doubts(channels: Sequence[MeasuredChannel], range_option: str) -> Iterator[OptionDoubt]:
    """Doubts about channels without a range. range_option : the key that states it, for a preset its own."""
    without = [channel.name for channel in channels if not channel.states_range]
    location = ("channels",) if range_option == RANGE_OPTION else (range_option,)
    return range_doubts(without, f"`{range_option}: [LOWEST, HIGHEST]`" if range_option else "", location)


def repeated(names: list[str]) -> str:
    """Repeated names in one text; "" for none."""
    return ", ".join(sorted({name for name in names if names.count(name) > 1}))
