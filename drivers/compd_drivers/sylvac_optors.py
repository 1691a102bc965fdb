r"""Sylvac instruments behind an OPTO-RS duplex cable (dial gauges, probes, callipers).

Source: Bowers Group, "Sylvac Opto Instruments", user's manual for OPTO-RS cable connections, page 12 (M, read in a
manual): 4800 baud, 7E2; `?` CR is answered by sign (+, -, blank), digits, point, digits, CR. Errors: ERR0 sensor
(speed, scale distance), ERR1 command, ERR2 parity of the request, ERR3 range. After power-on the instrument sends
`SY...` once: that is a mismatch here and never a value.
Not in the manual: the unit, which is set on the instrument and not sent. It is therefore an option without default.
The protocol has no checksum and no fixed width: set `decimals`, and a digit lost behind the point is found; a value
that jumps is asked for twice.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

from pydantic import Field

from compd_drivers.ascii_description import SerialAsciiOptions
from compd_drivers.exchange import WithoutChecksumOptions
from compd_drivers.serial_ascii import SerialAscii


class SylvacOptoRsOptions(WithoutChecksumOptions):
    """Options of an instrument behind an OPTO-RS cable."""

    unit: Literal["mm", "inch"] = Field(description="what the instrument is set to; it does not say")
    decimals: int | None = Field(default=None, ge=1, le=6, description="digits behind the point, as it shows them")
    range_mm: tuple[float, float] | None = Field(default=None, description="[lowest, highest] it can measure")


class SylvacOptoRs(SerialAscii):
    """One instrument, one channel `position` in mm."""

    Options = SylvacOptoRsOptions
    usual_line = (4800, "7E2")
    sample_options: ClassVar[Mapping[str, Any] | None] = {"unit": "mm", "decimals": 3}

    def __init__(self, options: SylvacOptoRsOptions) -> None:
        super().__init__(SerialAsciiOptions.model_validate(_description(options)))
        self.options = options


def _description(options: SylvacOptoRsOptions) -> dict[str, Any]:
    return {
        "driver": options.driver,
        "line": options.line,
        "fastest_mm_per_s": options.fastest_mm_per_s,
        "out": "?",
        "out_terminator": r"\r",
        "in": "% f" if options.decimals is None else f"% .{options.decimals}f",
        "in_terminator": r"\r",
        "channels": [{"name": "position", "unit": options.unit, "range": options.range_mm}],
        "errors": [
            {"in": "ERR0", "quality": "sensor_fault", "says": "sensor"},
            {"in": "ERR1", "quality": "device_error", "says": "command not known"},
            {"in": "ERR2", "quality": "device_error", "says": "it heard a wrong parity"},
            {"in": "ERR3", "quality": "over_range", "says": "beyond its range"},
        ],
    }
