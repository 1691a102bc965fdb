"""ICP DAS M-7017C: eight analogue inputs on Modbus RTU.

Source: I-7017(F)C, M-7017C quick start guide, Modbus table (M, read in a manual): 1200 to 115200 baud; input values at
30001 to 30008 (function 4, address 0 to 7); a setting makes them hexadecimal or engineering data. Over and under range
of the 4-20 and 0-20 mA ranges are discrete inputs from 10129 on, which a line of registers does not read: both ends of
the scale are taken as beyond it instead, in every range.
Plausible only (P): the scale of hexadecimal data is not in that guide. It is taken as in the like-built ADLINK ND-6017
(manual, pages 96 and 97: 7FFF = +full scale, 8000 = -full scale, one count = full scale / 32768) for the ranges with
both signs, and 0000 to FFFF for 0-20 mA and 4-20 mA. Compare once with a meter.
Engineering data is refused: its steps are not in the guide, and a wrong one would look like a measurement.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal, Self

from pydantic import Field, model_validator

from compd_drivers.analogue import SPANS, AnalogueInput, ModuleOptions, check_inputs, check_span, register_map
from compd_drivers.modbus import Modbus

FIRST_ADDRESS = 0
HALF_SCALE = 32768
FULL_SCALE = 65535


class M7017cInput(AnalogueInput):
    """One input of an M-7017C."""

    range: Literal["+-10V", "+-5V", "+-1V", "+-500mV", "+-150mV", "+-20mA", "0-20mA", "4-20mA"] = Field(
        description="what the input is set to in the module"
    )

    @model_validator(mode="after")
    def _signal_fits(self) -> Self:
        check_span(self, self.range)
        return self


class IcpdasM7017cOptions(ModuleOptions):
    """Options of an M-7017C."""

    data_format: Literal["hexadecimal"] = Field(description="what the module is set to; see to it that it is so")
    channels: tuple[M7017cInput, ...] = Field(min_length=1, description="the inputs that are wired")

    @model_validator(mode="after")
    def _once(self) -> Self:
        check_inputs(self.channels)
        return self


class IcpdasM7017c(Modbus):
    """One module; all its inputs in one read."""

    Options = IcpdasM7017cOptions
    sample_options: ClassVar[Mapping[str, Any]] = {
        "unit": 1,
        "data_format": "hexadecimal",
        "channels": [
            {
                "name": "a",
                "input": 0,
                "range": "+-10V",
                "linearisation": {"signal": "V", "table": [[-9.5, -0.95], [9.5, 0.95]]},
            },
            {
                "name": "b",
                "input": 3,
                "range": "4-20mA",
                "linearisation": {"signal": "mA", "polynomial": [-1.5, 0.125], "valid": [4, 20]},
            },
        ],
    }

    def __init__(self, options: IcpdasM7017cOptions) -> None:
        super().__init__(register_map(options, [_channel(one) for one in options.channels]))
        self.options = options


def _channel(one: M7017cInput) -> dict[str, Any]:
    span = SPANS[one.range]
    signed = span.low < 0
    return {
        "name": one.name,
        "function": 4,
        "address": FIRST_ADDRESS + one.input,
        "type": "int16" if signed else "uint16",
        "scale": span.high / HALF_SCALE if signed else (span.high - span.low) / FULL_SCALE,
        "offset": 0.0 if signed else span.low,
        "over_range": [HALF_SCALE - 1 if signed else FULL_SCALE],
        "under_range": [-HALF_SCALE if signed else 0],
        "linearisation": one.linearisation,
        "unit": one.unit,
        "lowest": one.lowest,
        "highest": one.highest,
    }
