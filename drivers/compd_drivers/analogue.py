"""Analogue input modules on Modbus: which input, its range, and the curve from V or mA to what is measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, NamedTuple

from pydantic import BaseModel, ConfigDict, Field

from compd.gauge import GaugeOptions, Unit
from compd_drivers.linearisation import Linearisation
from compd_drivers.modbus import ModbusOptions

INPUTS = 8  # of every module that is described here

Number = Annotated[float, Field(allow_inf_nan=False)]


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


class AnalogueInput(BaseModel):
    """One input that is wired to a sensor."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str = Field(pattern=r"^[A-Za-z0-9_]+$", description="name of the channel")
    input: int = Field(ge=0, lt=INPUTS, description="the module's input, from 0")
    linearisation: Linearisation = Field(description="from the signal to `unit`")
    unit: Unit = Field(default="mm", description="of what the sensor measures")
    lowest: Number | None = Field(default=None, description="smallest value that the sensor can deliver, in its unit")
    highest: Number | None = Field(default=None, description="greatest value that the sensor can deliver, in its unit")


class ModuleOptions(GaugeOptions):
    """Options of every module: where it is."""

    unit: int = Field(ge=1, le=247, description="slave address")


def register_map(options: ModuleOptions, channels: Sequence[Mapping[str, Any]]) -> ModbusOptions:
    """The module as the generic Modbus driver knows it: `channels` as under its key of that name."""
    return ModbusOptions.model_validate(
        {"driver": options.driver, "line": options.line, "unit": options.unit, "channels": channels}
    )


def check_inputs(inputs: Sequence[AnalogueInput]) -> None:
    """ValueError for an input that stands twice."""
    numbers = [one.input for one in inputs]
    if doubled := sorted({number for number in numbers if numbers.count(number) > 1}):
        raise ValueError(f"input {doubled[0]} stands twice")


def check_span(one: AnalogueInput, span: str) -> None:
    """ValueError where the linearisation begins with another signal than the input's range delivers."""
    signal = SPANS[span].signal
    if one.linearisation.signal != signal:
        raise ValueError(
            f"{one.name}: range {span} delivers {signal}, the linearisation wants {one.linearisation.signal}"
        )
