r"""TESA TESATRONIC TT80 and TT90: comparators with inductive probes.

Source: TESATRONIC TT80/TT90 manual, pages 94 and 95 (M, read in a manual): 4800 baud, 7E2; `?` CR is answered by
the displayed value and CR LF. Page 94 gives the forms

    TT80 (and TT90 in TT80 mode)   mm: +-xxxx.xx    inch: +-.xxxxxx
    TT90                           um: +-xxx.xxx    mil: +-(x)x.xxxx(x)

and page 95 `UNI?`, `RNG?`, `ID?` and errors `ERRnn`.
Not sure: the TT80's form has two decimals under the label mm, while its ranges are given in um (+-5000 to +-0.5), so
that the number may be um. The unit is therefore an option without default: find it with a gauge block before you
trust the gauge. Leading zeros are taken as zeros or blanks. What the replies to `UNI?` look like is not shown, so
nothing is asked but `?`. The display's functions (A-B, Min, Max) are what is sent: set it to the probe alone.
No checksum: a value that jumps is asked for twice.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal, Self

from pydantic import Field, model_validator

from compd_drivers.ascii_description import SerialAsciiOptions
from compd_drivers.exchange import WithoutChecksumOptions
from compd_drivers.serial_ascii import SerialAscii

# page 94; the inch form has no digit before the point, the mil form one or two
FORMS = {
    ("TT80", "mm"): "%+8.2f",
    ("TT80", "um"): "%+8.2f",
    ("TT80", "inch"): "%+.6f",
    ("TT90", "um"): "%+8.3f",
    ("TT90", "mil"): "%+f",
}


class TesaTt80Options(WithoutChecksumOptions):
    """Options of a TT80 or TT90."""

    model: Literal["TT80", "TT90"] = Field(description="a TT90 in TT80 mode is a TT80")
    unit: Literal["um", "mm", "inch", "mil"] = Field(description="of the number that it sends; see the driver's text")
    range_mm: tuple[float, float] | None = Field(default=None, description="[lowest, highest] the probe can measure")

    @model_validator(mode="after")
    def _form_known(self) -> Self:
        if (self.model, self.unit) not in FORMS:
            units = [unit for model, unit in FORMS if model == self.model]
            raise ValueError(f"a {self.model} sends {', '.join(units)}, not {self.unit}")
        return self


class TesaTt80(SerialAscii):
    """One comparator, one channel `position` in mm."""

    Options = TesaTt80Options
    usual_line = (4800, "7E2")
    sample_options: ClassVar[Mapping[str, Any] | None] = {"model": "TT90", "unit": "um"}
    sample_range: ClassVar[tuple[float, float] | None] = (-0.19, 0.19)

    def __init__(self, options: TesaTt80Options) -> None:
        super().__init__(SerialAsciiOptions.model_validate(_description(options)))
        self.options = options


def _description(options: TesaTt80Options) -> dict[str, Any]:
    return {
        "driver": options.driver,
        "line": options.line,
        "fastest_mm_per_s": options.fastest_mm_per_s,
        "out": "?",
        "out_terminator": r"\r",
        "in": FORMS[options.model, options.unit],
        "in_terminator": r"\r\n",
        "channels": [{"name": "position", "unit": options.unit, "range": options.range_mm}],
        "errors": [{"in": "ERR%*2[0-9]", "quality": "device_error"}],
    }
