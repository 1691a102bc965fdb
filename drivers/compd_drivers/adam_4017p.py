"""Advantech ADAM-4017+, ADAM-4117: eight analogue inputs on Modbus RTU.

Source: public code of Modbus clients (C, read in public code): 9600 baud 8N1 as delivered; inputs at 40001 to 40008,
read by function 3 (not 4), address 0 to 7. The value is raw / 65535 x (highest - lowest) + lowest of the input's range;
FFFF stands for an open or switched-off input, and would be full scale: it is never a value here. 0000, the lower end,
is taken as below the range: a lower current or voltage reads the same.
Not sure: where the module keeps each input's range; it is not compared with `range`, so that one that is set
differently in the module goes unseen. Compare both once with a meter.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal, Self

from pydantic import Field, model_validator

from compd_drivers.analogue import SPANS, AnalogueInput, ModuleOptions, check_inputs, check_span, register_map
from compd_drivers.modbus import Modbus

FULL_SCALE = 65535


class Adam4017pInput(AnalogueInput):
    """One input of an ADAM-4017+."""

    range: Literal["+-10V", "+-5V", "+-1V", "+-500mV", "+-150mV", "0-10V", "+-20mA", "0-20mA", "4-20mA"] = Field(
        description="what the input is set to in the module"
    )

    @model_validator(mode="after")
    def _signal_fits(self) -> Self:
        check_span(self, self.range)
        return self


class Adam4017pOptions(ModuleOptions):
    """Options of an ADAM-4017+."""

    channels: tuple[Adam4017pInput, ...] = Field(min_length=1, description="the inputs that are wired")

    @model_validator(mode="after")
    def _once(self) -> Self:
        check_inputs(self.channels)
        return self


class Adam4017p(Modbus):
    """One module; adjacent inputs in one read."""

    Options = Adam4017pOptions
    usual_line = (9600, "8N1")
    sample_options: ClassVar[Mapping[str, Any]] = {
        "unit": 1,
        "channels": [
            {
                "name": "a",
                "input": 0,
                "range": "+-10V",
                "linearisation": {"signal": "V", "table": [[-9.5, -0.95], [9.5, 0.95]]},
            },
            {
                "name": "b",
                "input": 7,
                "range": "4-20mA",
                "linearisation": {"signal": "mA", "polynomial": [-1.5, 0.125], "valid": [4, 20]},
            },
        ],
    }

    def __init__(self, options: Adam4017pOptions) -> None:
        super().__init__(register_map(options, [_channel(one) for one in options.channels]))
        self.options = options


def _channel(one: Adam4017pInput) -> dict[str, Any]:
    span = SPANS[one.range]
    return {
        "name": one.name,
        "function": 3,
        "address": one.input,
        "type": "uint16",
        "scale": (span.high - span.low) / FULL_SCALE,
        "offset": span.low,
        "invalid": [FULL_SCALE],
        "under_range": [0],
        "linearisation": one.linearisation,
        "unit": one.unit,
        "lowest": one.lowest,
        "highest": one.highest,
    }
