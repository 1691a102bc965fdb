r"""The interface between compd and a gauge driver.

A driver is a class derived from `Gauge`. It knows its device's bytes, or its registers, and nothing else: the thread of
the line calls `read`, and the line does the waiting, the timeouts and the recovery. A driver implements

- `Options`, where it has keys of its own in the configuration: a pydantic model,
- `channels`: the names and units of what one poll delivers,
- `read`: one poll of the device, to one `Reading` per channel.

A whole driver, of a comparator that answers ``?`` with its reading in mm, such as ``+01.2345``::

    import re
    from collections.abc import Sequence

    from compd.gauge import ByteLine, Channel, Gauge, LineFault, Quality, Reading, bad, good

    class MyGauge(Gauge[ByteLine]):
        @property
        def channels(self) -> Sequence[Channel]:
            return [Channel("value", "mm")]

        def read(self, line: ByteLine) -> Sequence[Reading]:
            time_s = line.send(b"?\r")
            reply = line.receive_until(b"\r\n", limit=10)
            if reply == b"OVER\r\n":
                return [bad(time_s, Quality.OVER_RANGE, "OVER")]
            if not re.fullmatch(rb"[+-]\d{2}\.\d{4}\r\n", reply):
                raise LineFault(Quality.MISMATCH, repr(reply))
            return [good(float(reply), time_s)]

Rules for every driver:

- The value is in the channel's unit: mm for every length, whatever the device displays.
- `time_s` is what `send` or `read_registers` returned, never the time of the reply.
- There is no number unless the reply fits exactly. What is damaged, cut short or out of range becomes a `Quality`.
- A channel that has no value is `bad` and the others go on; `LineFault` is for a poll that failed as a whole.
- `read` does not sleep, log or look at a clock, nor repeat a poll that failed: the line's thread decides when to ask
  again.

A driver is found by an entry point of the group ``compd.gauges``, or named in the configuration as
``driver: /etc/compd/my_gauge.py:MyGauge``. One that calls a library which may keep the interpreter or crash belongs on
a line with a process of its own, ``acquisition: {own_process: [LINE]}``. ``drivers/template`` is a complete package to
copy, with a simulated device; ``compd gauge test-driver`` tries a driver on wires that go wrong. A gauge whose protocol
the drivers `serial_ascii`, `serial_frame` or `modbus` can describe needs no class: it is a preset, a YAML file in a
folder of the entry-point group ``compd.gauge_presets``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Generic, Literal, NamedTuple, Protocol, TypeVar

from pydantic import BaseModel, ConfigDict, Field

from compd.reading import LineFault, Quality, Reading, ReadingMotion, bad, good, stands_for_no_number

__all__ = [
    "ByteLine",
    "Channel",
    "DataSheetNoise",
    "Gauge",
    "GaugeOptions",
    "LineFault",
    "LineKind",
    "OptionDoubt",
    "Quality",
    "Reading",
    "ReadingMotion",
    "RegisterLine",
    "RegisterReply",
    "Unit",
    "bad",
    "good",
    "replies_tell_whose",
    "stands_for_no_number",
]


Unit = Literal["mm", "degC", "N", "hPa", "pct", "1"]


@dataclass(frozen=True)
class Channel:
    """One value that a gauge delivers: its name, unique in the gauge, and its unit.

    The configuration and STATUS call it "gauge.channel". A length is in mm whatever the device displays; "pct" is per
    cent, "1" a number without unit.
    """

    name: str
    unit: Unit = "mm"


class ByteLine(Protocol):
    """A stream of bytes to one or more devices: a serial port or a TCP connection.

    Every method raises `LineFault` with TIMEOUT when nothing came, INCOMPLETE when something came but not enough, and
    LINE_LOST when the port is gone. A driver lets these pass: the line's thread knows what to do.
    """

    def send(self, request: bytes) -> float:
        """Discard what has arrived unsolicited, and write `request`.

        Returns the monotonic time (s) at which its last bit had left: the `time_s` of the readings in the reply.
        """
        ...

    def pulse_dtr(self, low_s: float) -> float:
        """Ask by DTR, which is LOW for at least `low_s` (s), and HIGH again.

        Returns the monotonic time (s) at which it became LOW: the `time_s` of the readings in the reply. LINE_LOST also
        where the port has no DTR.
        """
        ...

    def send_break(self, duration_s: float) -> None:
        """A break of at least `duration_s` (s) on the line, for devices that want one before a request."""
        ...

    def listen(self) -> float:
        """Discard what has arrived so far, of a device that sends unsolicited readings.

        Returns the monotonic time (s): the `time_s` of the readings that are received next.
        """
        ...

    def next_line(
        self, terminator: bytes, limit: int, timeout_s: float | None = None, gap_timeout_s: float | None = None
    ) -> tuple[bytes, float]:
        """The next whole line of a device that sends unsolicited readings, at its full rate, without `terminator`.

        Also returns its `time_s`: when the line before it began, which is read too where nothing is known of it. More
        than `limit` bytes raise MISMATCH. `timeout_s` is for the first byte, and must be longer than the device's
        period; `gap_timeout_s` is for each that follows. Where lines come faster than they are asked for, the newest
        counts.
        """
        ...

    def receive(self, count: int, timeout_s: float | None = None) -> bytes:
        """Exactly `count` bytes. `timeout_s` is for the first byte; None is the line's own timeout."""
        ...

    def receive_until(self, terminator: bytes, limit: int, timeout_s: float | None = None) -> bytes:
        """Bytes up to and including `terminator`, at most `limit` of them; more raise MISMATCH."""
        ...

    def drain(self) -> bytes:
        """Wait until nothing has come for the line's timeout, and return what came meanwhile.

        The line's thread does so after a fault. A driver needs it only between two exchanges of one poll.
        """
        ...


class RegisterReply(NamedTuple):
    """Registers read in one Modbus transaction.

    Attributes
    ----------
    registers : unsigned 16-bit values, or bits (0 or 1), in the order of their addresses.
    time_s : monotonic time (s) at which the request had left: the `time_s` of the readings.
    """

    registers: tuple[int, ...]
    time_s: float


class RegisterLine(Protocol):
    """A Modbus line: RTU, TCP or RTU over TCP. It raises `LineFault` as `ByteLine` does, also CRC and DEVICE_ERROR."""

    def read_registers(self, unit: int, function: int, address: int, count: int) -> RegisterReply:
        """`count` registers from `address` of the slave `unit`, by function code 3 (holding) or 4 (input).

        `address` counts from 0, as on the wire; manuals that write 40001 or 30001 mean address 0.
        """
        ...

    def read_bits(self, unit: int, function: int, address: int, count: int) -> RegisterReply:
        """`count` bits from `address` of the slave `unit`, by function code 1 (coils) or 2 (discrete inputs)."""
        ...

    def write(self, unit: int, function: int, address: int, values: Sequence[int], settle_s: float = 0.0) -> float:
        """Write to the slave `unit`, by function code 5 (one coil, 0 or 1), 6 (one register) or 16 (registers).

        Unit 0 of a serial line is all slaves at once, of which none answers. The next request follows after `settle_s`
        at the earliest. Returns the monotonic time (s) at which the request had left.
        """
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
        description="standard deviation of one reading of a length, um, its last digit included; left out: the data "
        "sheet's, where the driver has it; where neither is known, nor is the bound of the tip's error",
    )
    fastest_mm_per_s: float | None = Field(
        default=None,
        gt=0,
        allow_inf_nan=False,
        description="lengths: the fastest that what is measured moves; a faster reading is not believed",
    )
    acceleration_mm_per_s2: float | None = Field(
        default=None,
        gt=0,
        allow_inf_nan=False,
        description="lengths: the largest acceleration of what is measured; a reading that jumped is not believed",
    )
    absolute: bool | None = Field(
        default=None,
        description="lengths: whether the device shows the same value again after its power was off; false: it counts "
        "from where it was switched on; left out: what the driver knows of its device",
    )
    restart_s: float = Field(
        default=0.5,
        gt=0,
        allow_inf_nan=False,
        description="lengths: the shortest time in which the device can restart and count anew; after a shorter "
        "time without an answer the limits of motion judge its value",
    )
    trust_after_loss: bool = Field(
        default=False,
        description="lengths: the device keeps its power and goes on counting while only its cable is out, so that it "
        "needs no `compd accept` when it comes back",
    )


LineT = TypeVar("LineT")
LineKind = Literal["bytes", "registers", "nodes", "topics"]

# Bytes of damage before a reply on a serial line: of a single edge one, rarely two.
MAX_SKIPPED_BYTES = 3


class DataSheetNoise(NamedTuple):
    """What the data sheet of a device says of its scatter.

    um : standard deviation of one reading of a length, um, its last digit included: a digit of d gives d / sqrt(12)
        (GUM F.2.2.1). source : data sheet and page, and how the figure follows from it.
    """

    um: float
    source: str


class OptionDoubt(NamedTuple):
    """Something among a gauge's options that can be used and is probably a slip.

    location : of it, below the gauge's entry. what, value, next_step : as of `Problem`.
    """

    location: tuple[str | int, ...]
    what: str
    value: str
    next_step: str


class Gauge(ABC, Generic[LineT]):
    """Base of all drivers: one device on a line, `class MyGauge(Gauge[ByteLine])` or `Gauge[RegisterLine]`.

    A device that speaks by itself has a driver derived from `compd.pushed_gauge.PushedGauge`.

    One object serves one device, from one thread. `channels` and `read` must be implemented; the class variables are
    set where their defaults do not fit.

    Attributes
    ----------
    Options : the model of the gauge's keys in the configuration, `GaugeOptions` or derived from it.
    line_kind : "bytes" for a `ByteLine`, "registers" for a `RegisterLine`, "nodes" of OPC UA, "topics" of MQTT.
    integrity : "checksum" where the driver itself checks one (a Modbus line does it for its drivers); "format" where
        only the shape of a reply tells damage.
    sample_options : options, without `driver` and `line`, with which `compd gauge test-driver` tries the driver; None
        where they must be given in a file.
    sample_range : lowest and highest value that the gauge can show with these options, in its channels' unit.
    absolute : whether the device shows the same value again after its power was off (an LVDT, an absolute encoder). One
        that counts from where it was switched on does not; False also where it is not known.
    usual_line : baud rate and format as the device is delivered, for `compd gauge scan --probe`.
    about : what the device speaks and where that was read; "" if the module's docstring says it.
    """

    Options: ClassVar[type[GaugeOptions]] = GaugeOptions
    line_kind: ClassVar[LineKind] = "bytes"
    integrity: ClassVar[Literal["checksum", "format"]] = "format"
    sample_options: ClassVar[Mapping[str, Any] | None] = None
    sample_range: ClassVar[tuple[float, float] | None] = None
    absolute: ClassVar[bool] = False
    usual_line: ClassVar[tuple[int, str] | None] = None
    about: ClassVar[str] = ""

    def __init__(self, options: Any) -> None:
        """`options`: an instance of this class's `Options`, checked. No device is asked here: there is no line yet."""
        self.options = options

    @property
    @abstractmethod
    def channels(self) -> Sequence[Channel]:
        """What one `read` delivers, in this order; the same for the life of the object."""

    @abstractmethod
    def read(self, line: LineT) -> Sequence[Reading]:
        """Poll the device once.

        Returns one reading per channel, in their order, each with its own time and quality.
        Raises LineFault if the poll as a whole failed. Any other exception is reported as a defect of the driver.
        """

    @property
    def noise(self) -> DataSheetNoise | None:
        """Of its lengths, by the data sheet; `noise_um` in the configuration overrides it. None: nothing is known."""
        return None

    def doubts(self) -> Iterable[OptionDoubt]:
        """What of its options is probably a slip: `compd check` warns of it."""
        return ()

    @property
    def reply_identity(self) -> str | None:
        """How every reply with a value begins, where that says whose it is; None if it does not.

        On a line with several gauges whose replies do not differ in it, a late reply looks like the answer to the next
        request: see `replies_tell_whose`. Register lines tell replies apart themselves.
        """
        return None

    @property
    def line_needs(self) -> Mapping[Literal["dtr", "rts"], bool]:
        """State of DTR and RTS (True is HIGH) from which the device or its cable takes its power; {} where it does not.

        Its line is opened so, where the line's own keys `dtr` and `rts` are left out.
        """
        return {}

    @property
    def serial_signals(self) -> Sequence[Literal["DTR", "break"]]:
        """What its requests use of a serial port beside bytes: a TCP connection has neither."""
        return ()

    def traffic(self) -> Sequence[tuple[int, int]] | None:
        """(bytes sent, bytes received) of every exchange that one `read` makes, for planning lines; None = unknown.

        For a driver on registers these are the bytes on an RTU line, with address and checksum.
        """
        return None


def replies_tell_whose(gauges: Sequence[Gauge[Any]]) -> bool:
    """Whether every reply on a line with these gauges says whose it is: no identity is the beginning of another."""
    if len(gauges) < 2 or all(gauge.line_kind != "bytes" for gauge in gauges):
        return True
    identities = [gauge.reply_identity for gauge in gauges]
    return not any(
        a is None or b is None or a.startswith(b)
        for k, a in enumerate(identities)
        for m, b in enumerate(identities)
        if k != m
    )
