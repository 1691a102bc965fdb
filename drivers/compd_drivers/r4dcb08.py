"""R4DCB08: eight DS18B20 thermometers on Modbus RTU.

Source: public code of Modbus clients (C, read in public code; chmelat/r4dcb08 on GitHub among them): 9600 baud 8N1,
function 3, address 0 to 7, int16 in 0.1 degC; 0x8000 = no sensor; range -55 to +125 degC. A DS18B20 holds +85.0 degC
from power-on to its first conversion (P, plausible only): 85.0 is therefore never a value here.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from compd_drivers.analogue import ModuleOptions, register_map
from compd_drivers.modbus import Modbus

DEGC_PER_COUNT = 0.1
NO_SENSOR = -32768
POWER_ON = 850  # 85.0 degC
LOWEST_degC, HIGHEST_degC = -55.0, 125.0


class R4dcb08Options(ModuleOptions):
    """Options of an R4DCB08."""

    sensors: Annotated[tuple[Literal[1, 2, 3, 4, 5, 6, 7, 8], ...], Field(min_length=1)] = Field(
        description="the inputs that have a sensor, as printed on the module; channels are named 1 to 8"
    )


class R4dcb08(Modbus):
    """One module: channels `1` to `8` in degC."""

    Options = R4dcb08Options
    usual_line = (9600, "8N1")
    sample_options: ClassVar[Mapping[str, Any]] = {"unit": 1, "sensors": [1, 2, 8]}

    def __init__(self, options: R4dcb08Options) -> None:
        super().__init__(register_map(options, [_channel(sensor) for sensor in sorted(set(options.sensors))]))
        self.options = options


def _channel(sensor: int) -> dict[str, Any]:
    return {
        "name": str(sensor),
        "function": 3,
        "address": sensor - 1,
        "type": "int16",
        "scale": DEGC_PER_COUNT,
        "unit": "degC",
        "invalid": [NO_SENSOR, POWER_ON],
        "lowest": LOWEST_degC,
        "highest": HIGHEST_degC,
    }
