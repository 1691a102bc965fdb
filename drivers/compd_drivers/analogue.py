"""Analogue input modules on Modbus: input, range, and the curve from V or mA to the measured quantity.

A preset describes the module itself in its section `inputs`; what is wired to it is the person's to say.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal, NamedTuple, Self

from pydantic import AfterValidator, Field, create_model, model_validator
from pydantic.fields import FieldInfo

from compd.gauge import Unit
from compd_drivers.linearisation import Linearisation
from compd_drivers.measured import DescriptionSection
from compd_drivers.modbus_description import Address, Status
from compd_drivers.modbus_number import NumberType

INPUTS = 8  # inputs of every module described here

Number = Annotated[float, Field(allow_inf_nan=False)]
RangeName = Literal["+-10V", "+-5V", "+-1V", "+-500mV", "+-150mV", "0-10V", "+-20mA", "0-20mA", "4-20mA"]


class Span(NamedTuple):
    """An input's range: its ends, in `signal`."""

    signal: str
    low: float
    high: float


SPANS: Mapping[str, Span] = {
    "+-10V": Span("V", -10.0, 10.0),
    "+-5V": Span("V", -5.0, 5.0),
    "+-1V": Span("V", -1.0, 1.0),
    "+-500mV": Span("V", -0.5, 0.5),
    "+-150mV": Span("V", -0.15, 0.15),
    "0-10V": Span("V", 0.0, 10.0),
    "+-20mA": Span("mA", -20.0, 20.0),
    "0-20mA": Span("mA", 0.0, 20.0),
    "4-20mA": Span("mA", 4.0, 20.0),
}


class AnalogueInput(DescriptionSection):
    """One input with a sensor."""

    name: str = Field(pattern=r"^[A-Za-z0-9_]+$", description="name of the channel")
    input: int = Field(ge=0, lt=INPUTS, description="the module's input, from 0")
    linearisation: Linearisation = Field(description="from the signal to `unit`")
    unit: Unit = Field(default="mm", description="of what the sensor measures")
    lowest: Number | None = Field(default=None, description="smallest value that the sensor can deliver, in its unit")
    highest: Number | None = Field(default=None, description="greatest value that the sensor can deliver, in its unit")


class AnalogueData(DescriptionSection):
    """Form of an input's signal in the module."""

    type: NumberType = Field(description="how the number is stored")
    counts: tuple[int, int] | None = Field(
        default=None, description="raw numbers at the lower and the upper end of the range; left out: V or mA itself"
    )
    ranges: tuple[RangeName, ...] = Field(default=(), description="the ranges to which an input may be set")
    invalid: tuple[Number, ...] = Field(default=(), description="raw numbers that mean: no value")
    over_range: tuple[Number, ...] = Field(default=(), description="raw numbers that mean: at or above full scale")
    under_range: tuple[Number, ...] = Field(default=(), description="raw numbers that mean: at or below zero scale")

    @model_validator(mode="after")
    def _check_counts(self) -> Self:
        if (self.counts is None) != (not self.ranges):
            raise ValueError("`counts` and `ranges` belong together")
        return self

    def channel(self, range_name: str | None) -> dict[str, Any]:
        """Type, special numbers, scale and offset: signal = low + (raw - counts[0]) (high - low) / (counts[1] -
        counts[0])."""
        channel: dict[str, Any] = {
            "type": self.type,
            "invalid": self.invalid,
            "over_range": self.over_range,
            "under_range": self.under_range,
        }
        if self.counts is not None and range_name is not None:
            _, low, high = SPANS[range_name]
            first, last = self.counts
            channel["scale"] = (high - low) / (last - first)
            channel["offset"] = low - first * channel["scale"]
        return channel


class AnalogueModule(DescriptionSection):
    """The registers of a module of eight inputs."""

    function: Literal[3, 4] = Field(description="3: holding registers, 4: input registers")
    address: Address = Field(description="register of input 0, from 0")
    step: int = Field(default=1, ge=1, description="registers from one input to the next")
    status: Status | None = Field(default=None, description="status register of input 0; the others follow one by one")
    data: tuple[AnalogueData, ...] = Field(min_length=1, description="how the signal is given, by range")

    @property
    def ranges(self) -> tuple[RangeName, ...]:
        """All settings of an input; empty for a module that delivers V or mA."""
        return tuple(name for data in self.data for name in data.ranges)

    def field(self, model_name: str) -> tuple[Any, FieldInfo]:
        """Annotation and field of the option `channels`, for pydantic. `model_name`: of the model of one input."""
        model: Any = AnalogueInput
        if self.ranges:
            choice: Any = Literal[self.ranges]
            setting = Field(description="what the input is set to in the module")
            model = create_model(
                model_name,
                __base__=_RangedInput,
                __module__=__name__,
                __doc__=AnalogueInput.__doc__,
                range=(choice, setting),
            )
        inputs: Any = Annotated[tuple[model, ...], AfterValidator(_check_once)]
        return inputs, Field(min_length=1, description="the inputs that are wired")

    def channels(self, inputs: Sequence[AnalogueInput]) -> list[dict[str, Any]]:
        """`channels` of the driver `modbus` for the inputs that are wired."""
        return [self._channel(wired) for wired in inputs]

    def _channel(self, wired: AnalogueInput) -> dict[str, Any]:
        range_name = wired.range if isinstance(wired, _RangedInput) else None
        data = next(data for data in self.data if range_name is None or range_name in data.ranges)
        channel = {
            "name": wired.name,
            "function": self.function,
            "address": self.address + self.step * wired.input,
            "linearisation": wired.linearisation,
            "unit": wired.unit,
            "lowest": wired.lowest,
            "highest": wired.highest,
            **data.channel(range_name),
        }
        if self.status is not None:
            channel["status"] = self.status.model_copy(update={"address": self.status.address + wired.input})
        return channel


class _RangedInput(AnalogueInput):
    """An input with a range set in the module; a derived model lists the module's ranges."""

    range: str

    @model_validator(mode="after")
    def _check_signal(self) -> Self:
        signal = SPANS[self.range].signal
        if self.linearisation.signal != signal:
            raise ValueError(
                f"{self.name}: range {self.range} delivers {signal}, the linearisation wants "
                f"{self.linearisation.signal}"
            )
        return self


def _check_once(inputs: tuple[AnalogueInput, ...]) -> tuple[AnalogueInput, ...]:
    """ValueError for a repeated input."""
    numbers = [wired.input for wired in inputs]
    if doubled := sorted({number for number in numbers if numbers.count(number) > 1}):
        raise ValueError(f"input {doubled[0]} is given twice")
    return inputs
