"""Micro-Epsilon induSENSOR MSC7401, MSC7602, MSC7802 and DTD: LVDT and LDR controllers on RS-485.

Source: operating instructions MSC7401/7802/7602, appendix A 4.4.4, the DTD's, page 100, and IF2035-PROFINET,
page 60 (M, read in three manuals): 256000 baud (9600 optional), 8E1; controller address 2 to 126, as delivered 126;
master 1.

    10 DA 01 4C CS 16                                      CS = sum mod 256 of DA 01 4C
    68 0B 0B 68 01 DA 08 float32 float32 CS 16             little endian; CS = sum from 01 on
    10 7E 01 4C CB 16 -> 68 0B 0B 68 01 7E 08 AE 47 61 3F 00 00 00 00 1C 16   = 0.88 V unscaled

The first float is the sensor's signal in V, the second the value scaled as the controller was set up; a scaled 0
says that it was not set up, and is never a measurement here. What unit it was scaled to is not on the wire.
Controllers of several channels (MSC7602) answer with one of them per address, as far as the manuals show (P).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal, Self

from pydantic import Field, model_validator

from compd.gauge import GaugeOptions
from compd_drivers.linearisation import Linearisation
from compd_drivers.serial_frame import SerialFrame, SerialFrameOptions

MASTER = 0x01
GET_VALUE = 0x4C
UNSCALED_AT, SCALED_AT = 7, 11
FIRST_CHECKED = 4  # byte of the reply from which its checksum counts


class MicroEpsilonMsc7Options(GaugeOptions):
    """Options of one controller."""

    address: int = Field(ge=2, le=126, description="of the controller; 126 as delivered")
    value: Literal["scaled", "unscaled"] = Field(description="scaled by the controller, or its signal in V")
    unit: Literal["mm", "um", "V"] = Field(description="scaled: what it was set up for; unscaled: V")
    linearisation: Linearisation | None = Field(default=None, description="from V to mm")
    range_mm: tuple[float, float] | None = Field(default=None, description="[lowest, highest] the sensor can measure")

    @model_validator(mode="after")
    def _unit_fits(self) -> Self:
        if self.value == "unscaled" and self.unit != "V":
            raise ValueError("the unscaled value is in V")
        if (self.unit == "V") != (self.linearisation is not None):
            raise ValueError("V needs a `linearisation`, mm and um have none")
        return self


class MicroEpsilonMsc7(SerialFrame):
    """One controller, one channel `position` in mm."""

    Options = MicroEpsilonMsc7Options
    usual_line = (256000, "8E1")
    sample_options: ClassVar[Mapping[str, Any] | None] = {"address": 126, "value": "scaled", "unit": "mm"}

    def __init__(self, options: MicroEpsilonMsc7Options) -> None:
        super().__init__(SerialFrameOptions.model_validate(_description(options)))
        self.options = options


def _description(options: MicroEpsilonMsc7Options) -> dict[str, Any]:
    asked = bytes((options.address, MASTER, GET_VALUE))
    scaled = options.value == "scaled"
    return {
        "driver": options.driver,
        "line": options.line,
        "out": (b"\x10" + asked + bytes([sum(asked) % 256]) + b"\x16").hex(" "),
        "frame": f"68 0B 0B 68 {MASTER:02X} {options.address:02X} 08 .. .. .. .. .. .. .. .. CS 16",
        "checksum": {"kind": "sum8", "first": FIRST_CHECKED},
        "channels": [
            {
                "name": "position",
                "at": SCALED_AT if scaled else UNSCALED_AT,
                "type": "float32",
                "byte_order": "little",
                "unit": options.unit,
                "linearisation": options.linearisation,
                "range": options.range_mm,
                "invalid": {0.0: "device_error"} if scaled else {},
            }
        ],
    }
