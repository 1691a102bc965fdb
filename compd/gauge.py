"""What a gauge driver implements, and what it delivers.

A driver is a class derived from `Gauge`, named in the entry-point group `compd.gauges` (or by
`driver: /etc/compd/my_gauge.py:MyGauge`); a gauge that is pure description is a preset instead, a YAML file in a folder
of the group `compd.gauge_presets`. A driver knows its device's bytes and nothing else: the line's
thread calls `read`, and the line does the waiting, the timeouts and the recovery.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, ClassVar, Generic, Literal, NamedTuple, Protocol, TypeVar

from pydantic import BaseModel, ConfigDict, Field


class Quality(StrEnum):
    """Why a reading is good or not. Only OK carries a number that may be used."""

    OK = "ok"
    NEVER_READ = "never_read"  # nothing has been asked yet
    TIMEOUT = "timeout"  # no byte came
    INCOMPLETE = "incomplete"  # the reply was cut short
    CRC = "crc"  # a checksum or parity does not fit
    MISMATCH = "mismatch"  # a whole reply, but not to what was asked
    DEVICE_ERROR = "device_error"  # the device answered with an error of its own
    OVER_RANGE = "over_range"
    UNDER_RANGE = "under_range"
    SENSOR_FAULT = "sensor_fault"
    NOT_FINITE = "not_finite"
    SILENT = "silent"  # silent by design (in its menu), not lost
    LINE_LOST = "line_lost"  # the port is gone; the line is backing off
    DRIVER_ERROR = "driver_error"  # the driver itself failed: a defect in it, to be reported
    STALE = "stale"  # was good, is too old now


class Reading(NamedTuple):
    """One channel of one gauge at one time.

    value : in the channel's unit (mm for every length); nan unless quality is OK.
    time_s : monotonic seconds when the request left the port: the earliest time at which the device
        can have sampled, so an age is never understated.
    quality : OK or the reason why there is no value.
    detail : what was seen, for a person ("ER,MS,31"); "" when OK.
    """

    value: float
    time_s: float
    quality: Quality
    detail: str = ""

    @property
    def ok(self) -> bool:
        return self.quality is Quality.OK


def good(value: float, time_s: float) -> Reading:
    """A reading with a number; not finite is refused here, once, for every driver."""
    if not math.isfinite(value):
        return bad(time_s, Quality.NOT_FINITE, repr(value))
    return Reading(value, time_s, Quality.OK)


def bad(time_s: float, quality: Quality, detail: str = "") -> Reading:
    """A reading without a number, and why."""
    return Reading(math.nan, time_s, quality, detail)


class LineFault(Exception):
    """A poll that failed as a whole; every channel of the gauge takes this quality."""

    def __init__(self, quality: Quality, detail: str = "") -> None:
        super().__init__(f"{quality}: {detail}" if detail else str(quality))
        self.quality = quality
        self.detail = detail


Unit = Literal["mm", "degC", "N", "hPa", "pct", "1"]


@dataclass(frozen=True)
class Channel:
    """One value that a gauge delivers: its name (unique in the gauge) and unit."""

    name: str
    unit: Unit = "mm"


class ByteLine(Protocol):
    """A stream of bytes to one or more devices: a serial port or a TCP connection.

    Every method raises `LineFault`: TIMEOUT when nothing came, INCOMPLETE when something did but not
    enough, LINE_LOST when the port is gone.
    """

    def send(self, request: bytes) -> float:
        """Discard what is waiting, write `request`; the monotonic time (s) at which it had left."""
        ...

    def listen(self) -> float:
        """Discard what is waiting, of a device that speaks unasked; the monotonic time (s) of it."""
        ...

    def receive(self, count: int, timeout_s: float | None = None) -> bytes:
        """Exactly `count` bytes; `timeout_s` for the first byte, the line's own if None."""
        ...

    def receive_until(self, terminator: bytes, limit: int, timeout_s: float | None = None) -> bytes:
        """Bytes up to and including `terminator`; MISMATCH beyond `limit` bytes."""
        ...

    def drain(self) -> bytes:
        """After a fault: wait until the line has been quiet for its timeout; what came meanwhile."""
        ...


class RegisterReply(NamedTuple):
    """Registers read in one Modbus transaction: unsigned 16-bit values, and the time of asking (s)."""

    registers: tuple[int, ...]
    time_s: float


class RegisterLine(Protocol):
    """A Modbus line (RTU, TCP or RTU over TCP); raises `LineFault` like `ByteLine`."""

    def read_registers(self, unit: int, function: int, address: int, count: int) -> RegisterReply:
        """`count` registers from `address` of slave `unit` by function code 3 or 4."""
        ...


class GaugeOptions(BaseModel):
    """Keys that every gauge has in the configuration; a driver's own `Options` adds its keys."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    driver: str = Field(description="entry point in `compd.gauges`, or /absolute/file.py:ClassName")
    line: str = Field(description="the line (under `lines:`) that this gauge is wired to")
    stale_after_s: float | None = Field(
        default=None,
        gt=0,
        allow_inf_nan=False,
        description="a reading older than this is stale; the loop's own stale_after_s if left out",
    )
    noise_um: float | None = Field(
        default=None,
        gt=0,
        allow_inf_nan=False,
        description="standard deviation of one reading of a length, um; where it is missing nobody knows the tip's",
    )


LineT = TypeVar("LineT", ByteLine, RegisterLine)


class Gauge(ABC, Generic[LineT]):
    """One device on a line: `class MyGauge(Gauge[ByteLine])` or `Gauge[RegisterLine]`.

    Subclasses set the class variables, take their `Options` in `__init__`, and implement two members.

    integrity : "checksum" where the driver itself checks one (a Modbus line does it for its drivers);
        "format" where only the shape of a reply tells damage.
    sample_options : options, without `driver` and `line`, with which `compd driver test` tries the driver.
    sample_range : what the gauge can show with these options, in its channels' unit.
    usual_line : baud rate and format as the device is delivered, for `compd gauge scan --probe`.
    about : what the device speaks and where that was read; "" where the module's docstring says it.
    """

    Options: ClassVar[type[GaugeOptions]] = GaugeOptions
    line_kind: ClassVar[Literal["bytes", "registers"]] = "bytes"
    integrity: ClassVar[Literal["checksum", "format"]] = "format"
    sample_options: ClassVar[Mapping[str, Any] | None] = None
    sample_range: ClassVar[tuple[float, float] | None] = None
    usual_line: ClassVar[tuple[int, str] | None] = None
    about: ClassVar[str] = ""

    def __init__(self, options: Any) -> None:
        """`options` is an instance of this class's `Options`."""
        self.options = options

    @property
    @abstractmethod
    def channels(self) -> Sequence[Channel]:
        """What one `read` delivers, in order."""

    @abstractmethod
    def read(self, line: LineT) -> Sequence[Reading]:
        """Poll the device once: one reading per channel, in their order, each with its own time.

        Raises LineFault where the poll as a whole failed.
        """

    def traffic(self) -> Sequence[tuple[int, int]] | None:
        """(bytes sent, bytes received) of every exchange that one `read` makes, for planning; None = unknown.

        For a driver on registers: as on an RTU line, with address and checksum.
        """
        return None
