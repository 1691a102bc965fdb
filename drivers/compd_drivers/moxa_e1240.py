"""Moxa ioLogik E1240: eight analogue inputs on Modbus TCP.

Source: ioLogik E1200 series user's manual, E1240 Modbus address and register map (M, read in a manual): port 502;
function 4; AI_scaledValue at 0x0008 to 0x0017, float32, high word first; AI_status at 0x003C to 0x0043:
0 normal, 1 burn-out, 2 over range, 3 under range. Without a scaling set up in the module the value is in
V or mA (P, plausible only); that is what this preset expects. Where the
module scales to mm itself, describe it with the driver `modbus`.
The values are read before the status, so that a wire that breaks between the two reads does not pass; one that is
mended between them may pass once with the module's filter still settling.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Self

from pydantic import Field, model_validator

from compd_drivers.analogue import AnalogueInput, ModuleOptions, check_inputs, register_map
from compd_drivers.modbus import Modbus

VALUES_ADDRESS = 0x0008
STATUS_ADDRESS = 0x003C


class MoxaE1240Options(ModuleOptions):
    """Options of an E1240."""

    channels: tuple[AnalogueInput, ...] = Field(min_length=1, description="the inputs that are wired")

    @model_validator(mode="after")
    def _once(self) -> Self:
        check_inputs(self.channels)
        return self


class MoxaE1240(Modbus):
    """One module; values in one read, their status in a second."""

    Options = MoxaE1240Options
    sample_options: ClassVar[Mapping[str, Any]] = {
        "unit": 1,
        "channels": [
            {"name": "a", "input": 0, "linearisation": {"signal": "V", "table": [[0, -0.95], [10, 0.95]]}},
            {"name": "b", "input": 7, "linearisation": {"signal": "mA", "polynomial": [-1.5, 0.125], "valid": [4, 20]}},
        ],
    }

    def __init__(self, options: MoxaE1240Options) -> None:
        super().__init__(register_map(options, [_channel(one) for one in options.channels]))
        self.options = options


def _channel(one: AnalogueInput) -> dict[str, Any]:
    return {
        "name": one.name,
        "function": 4,
        "address": VALUES_ADDRESS + 2 * one.input,
        "type": "float32",
        "word_order": "high_first",
        "status": {"address": STATUS_ADDRESS + one.input, "ok": [0], "over_range": [2], "under_range": [3]},
        "linearisation": one.linearisation,
        "unit": one.unit,
        "lowest": one.lowest,
        "highest": one.highest,
    }
