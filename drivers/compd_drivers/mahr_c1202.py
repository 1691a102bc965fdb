r"""Mahr Millimar C1202: a column amplifier with up to three features (inductive probes).

Source: Millimar C1202 operating instructions, page 82 (M, read in a manual): duplex interface, 9600 baud, 7E2,
everything ends with CR. `?` asks for all features:

    1 +-XXX.XX unit;2 ERR6;3 +-XXX.XX unit =

unit = mm um inch deg rad dms, digits as displayed with leading zeros; behind it, where tolerances are active, one
judgement of < = > and, where warning limits are active, a second one: neither touches the value. ERR6 stands for a
feature that is off. `M1?` asks for one feature. The unit on the wire is compared with the configured one.
Not in the manual: other errors; `ERRn` is read as an error of that feature. No checksum: a value that jumps is asked
for twice.

While somebody is in its menu the C1202 does not answer. If it had answered on this connection before, that is
`silent` from the second time on; if it never had, `timeout`. A cable pulled off at the instrument looks the same.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from compd.gauge import ByteLine, Channel, Gauge, GaugeOptions, LineFault, Quality, Reading, bad, good
from compd_drivers.exchange import MenuSilence, receive_line

CR = b"\r"
MAX_REPLY = 80  # three features of at most 26 characters
FEATURES = (1, 2, 3)
MM_PER_UNIT = {"mm": 1.0, "um": 1e-3, "inch": 25.4}
_ERROR = re.compile(rb"([123]) ERR(\d)")
FEATURE_OFF = b"6"


class MahrC1202Options(GaugeOptions):
    """Options of a C1202."""

    features: Annotated[tuple[Literal[1, 2, 3], ...], Field(min_length=1)] = Field(
        description="features to read; channels are named 1, 2, 3"
    )
    unit: Literal["mm", "um", "inch"] = Field(description="its unit; any other one on the wire is refused")
    digits: int = Field(ge=1, le=6, description="digits before the point, leading zeros included")
    decimals: int = Field(ge=1, le=6, description="digits behind the point")


class MahrC1202(Gauge[ByteLine]):
    """The configured features: channels `1`, `2`, `3` in mm."""

    Options = MahrC1202Options
    line_kind = "bytes"
    usual_line = (9600, "7E2")
    sample_options: ClassVar[Mapping[str, Any] | None] = {
        "features": [1, 3],
        "unit": "um",
        "digits": 4,
        "decimals": 1,
    }

    def __init__(self, options: MahrC1202Options) -> None:
        super().__init__(options)
        self._features = tuple(sorted(set(options.features)))
        self._channels = tuple(Channel(str(feature)) for feature in self._features)
        self._asked = self._features if len(self._features) == 1 else FEATURES
        self._request = (f"M{self._features[0]}?" if len(self._features) == 1 else "?").encode() + CR
        self._value = re.compile(
            rb"([123]) ([+-]\d{%d}\.\d{%d}) (mm|um|inch)(?: [<=>]){0,2}" % (options.digits, options.decimals)
        )
        self._silence = MenuSilence()

    @property
    def channels(self) -> Sequence[Channel]:
        return self._channels

    def traffic(self) -> Sequence[tuple[int, int]]:
        feature = len("1 +.mm ") + self.options.digits + self.options.decimals + len(" < <")
        return [(len(self._request), len(self._asked) * (feature + 1))]

    def read(self, line: ByteLine) -> Sequence[Reading]:
        """Raises LineFault: SILENT or TIMEOUT (see above), MISMATCH unless the requested features answer."""
        time_s = line.send(self._request)
        try:
            reply = receive_line(line, CR, MAX_REPLY)
            readings = self._readings(reply, time_s)
        except LineFault as fault:
            raise self._silence.named(fault, line) from None
        self._silence.answered(line)
        return readings

    def _readings(self, reply: bytes, time_s: float) -> list[Reading]:
        parts = [part.strip(b" ") for part in reply.split(b";")]
        if len(parts) != len(self._asked):
            raise LineFault(Quality.MISMATCH, f"{len(parts)} features answered, {len(self._asked)} asked: {reply!r}")
        readings = []
        for feature, part in zip(self._asked, parts, strict=True):
            if part[:1] != str(feature).encode():
                raise LineFault(Quality.MISMATCH, f"asked feature {feature}: {reply!r}")
            reading = self._reading(part, time_s, reply)
            if feature in self._features:
                readings.append(reading)
        return readings

    def _reading(self, part: bytes, time_s: float, reply: bytes) -> Reading:
        if error := _ERROR.fullmatch(part):
            why = ": the feature is off" if error[2] == FEATURE_OFF else ""
            return bad(time_s, Quality.DEVICE_ERROR, part.decode() + why)
        match = self._value.fullmatch(part)
        if match is None:
            raise LineFault(
                Quality.MISMATCH, f"not a value of {self.options.digits} and {self.options.decimals} digits: {reply!r}"
            )
        if match[3] != self.options.unit.encode():
            raise LineFault(Quality.MISMATCH, f"it is set to {match[3].decode()}, not {self.options.unit}")
        return good(float(match[2]) * MM_PER_UNIT[self.options.unit], time_s)
