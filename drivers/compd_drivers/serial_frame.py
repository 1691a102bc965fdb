"""Generic binary gauge: a request, and a reply of fixed length with a checksum, described in the configuration.

`frame` is the reply byte by byte, as a manual draws it: hexadecimal bytes that are always so, `..` for a byte that
may be anything, `CS` for each byte of the checksum (in `out`, too, with an `out_checksum`). `at` counts from 0.
Micro-Epsilon MSC7401, appendix 4.4.4:

    driver: serial_frame
    line: rs485
    out:   "10 7E 01 4C CB 16"
    frame: "68 0B 0B 68 01 7E 08 .. .. .. .. .. .. .. .. CS 16"
    checksum: {kind: sum8, first: 4}
    channels:
      - {name: gap, at: 11, type: float32, byte_order: little, unit: mm, range: [-1, 1], invalid: {0: device_error}}

A frame without a checksum must have fixed bytes, or nothing could tell a reply from noise. Its lengths are asked for a
second time where they are not where the last ones lead, as those of all gauges are. `errors` are frames that stand for
the whole poll; they may be shorter than the reply.
"""

from __future__ import annotations

import itertools
import re
import struct
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self

from pydantic import Field, model_validator

from compd.gauge import (
    ByteLine,
    Channel,
    Gauge,
    GaugeOptions,
    LineFault,
    OptionDoubt,
    Quality,
    Reading,
    bad,
    stands_for_no_number,
)
from compd.lines import CHECKSUMS, ChecksumKind
from compd_drivers.exchange import ExchangeOptions, ask, following, nothing_behind, receive
from compd_drivers.measured import (
    RANGE_OPTION,
    DescriptionSection,
    MeasuredChannel,
    ReplyQuality,
    doubts,
    not_measured,
    repeated,
)
from compd_drivers.no_number import full_scale

NumberType = Literal["int8", "uint8", "int16", "uint16", "int24", "uint24", "int32", "uint32", "float32", "float64"]
_TOKEN = re.compile(r"[0-9A-Fa-f]{2}|\.\.|CS")
_FLOATS: Mapping[str, str] = {"float32": "f", "float64": "d"}
MIN_FIXED_BYTES = 2  # fewest fixed bytes of a frame without a checksum


class FrameLayout(NamedTuple):
    """A reply's bytes (None for any byte), and the position of the checksum."""

    fixed: tuple[int | None, ...]
    checksum: slice

    @classmethod
    def of(cls, text: str) -> Self:
        """ValueError unless it consists of hexadecimal bytes, `..` and one run of `CS`."""
        tokens = text.split()
        for token in tokens:
            if not _TOKEN.fullmatch(token):
                raise ValueError(f"{token!r} is neither a hexadecimal byte, nor `..`, nor `CS`")
        places = [k for k, token in enumerate(tokens) if token == "CS"]
        if places and places != list(range(places[0], places[-1] + 1)):
            raise ValueError("the checksum's bytes `CS` must stand together")
        fixed = tuple(None if token in {"..", "CS"} else int(token, 16) for token in tokens)
        return cls(fixed, slice(places[0], places[-1] + 1) if places else slice(0, 0))

    @property
    def beginning(self) -> bytes:
        """The fixed bytes before all others."""
        return bytes(itertools.takewhile(lambda byte: byte is not None, self.fixed))  # type: ignore[arg-type]

    def fits(self, data: bytes) -> bool:
        """Whether `data` has this length and these fixed bytes."""
        pairs = zip(self.fixed, data, strict=False)
        return len(data) == len(self.fixed) and all(fixed in (None, byte) for fixed, byte in pairs)


class FrameChecksum(DescriptionSection):
    """Computation of a frame's checksum."""

    kind: ChecksumKind = Field(description="how it is computed")
    first: Annotated[int, Field(ge=0)] = Field(default=0, description="first byte that it covers, from 0")
    end: Annotated[int, Field(ge=1)] | None = Field(
        default=None, description="byte before which it ends; the checksum itself if left out"
    )
    byte_order: Literal["little", "big"] = Field(default="little", description="of a checksum of two bytes")

    def of(self, data: bytes, place: slice) -> bytes:
        """The checksum for position `place` of `data`."""
        checksum = CHECKSUMS[self.kind].of(data[self.first : place.start if self.end is None else self.end])
        return checksum if self.byte_order == "little" else checksum[::-1]

    def check(self, frame: FrameLayout, key: str) -> None:
        """ValueError if `frame`, the option `key`, has no place for this checksum."""
        if self.kind == "modbus_lrc":
            raise ValueError(
                f"`{key}` has no digits: modbus_lrc is of hexadecimal digits, in bytes it is negative_sum8"
            )
        length = frame.checksum.stop - frame.checksum.start
        if length != CHECKSUMS[self.kind].length:
            raise ValueError(f"`{key}` has {length} bytes CS, its checksum makes {CHECKSUMS[self.kind].length}")
        if not self.first < (self.end or frame.checksum.start) <= len(frame.fixed):
            raise ValueError(f"the checksum of `{key}` covers nothing: see `first` and `end`")


class FrameChannel(MeasuredChannel):
    """One number in the frame."""

    at: Annotated[int, Field(ge=0)] = Field(description="its first byte, from 0")
    type: NumberType = Field(description="how the number is stored")
    byte_order: Literal["little", "big"] = Field(default="little", description="of a number in several bytes")
    invalid: dict[float, ReplyQuality] = Field(
        default={}, description="numbers with a special meaning, and their qualities"
    )

    @property
    def length(self) -> int:
        """Length of the number in bytes."""
        return int(re.sub(r"\D", "", self.type)) // 8

    @cached_property
    def full_scale(self) -> frozenset[float]:
        """Its full-scale words as numbers."""
        whole = self.type not in _FLOATS
        return full_scale(8 * self.length, self.type.startswith("int")) if whole else frozenset()

    def number(self, data: bytes) -> float:
        """The number in a whole frame, unscaled."""
        raw = data[self.at : self.at + self.length]
        if code := _FLOATS.get(self.type):
            (value,) = struct.unpack(f"{'<' if self.byte_order == 'little' else '>'}{code}", raw)
            return float(value)
        return float(int.from_bytes(raw, self.byte_order, signed=self.type.startswith("int")))


class ErrorFrame(DescriptionSection):
    """An error reply, which counts for the whole poll."""

    frame: str = Field(description="its bytes, as in `frame`")
    quality: ReplyQuality = Field(description="what it means")
    says: str = Field(default="", description="in words, for the status")


class SerialFrameOptions(ExchangeOptions):
    """Options of a described binary gauge."""

    out: str = Field(min_length=2, description="the request in hexadecimal bytes, its checksum included")
    out_checksum: FrameChecksum | None = Field(
        default=None, description="how `CS` in `out` is made, where it is not written out"
    )
    frame: str = Field(min_length=2, description="the reply: hexadecimal bytes, `..` for any, `CS` for the checksum")
    checksum: FrameChecksum | None = Field(default=None, description="how `CS` is made")
    channels: tuple[FrameChannel, ...] = Field(min_length=1, description="the numbers in the reply")
    errors: tuple[ErrorFrame, ...] = Field(default=(), description="replies that are errors")

    @model_validator(mode="after")
    def _whole(self) -> Self:
        if doubled := repeated([channel.name for channel in self.channels]):
            raise ValueError(f"channel named twice: {doubled}")
        if self.out_checksum is None:
            bytes.fromhex(self.out)
        else:
            self.out_checksum.check(FrameLayout.of(self.out), "out")
        frame = FrameLayout.of(self.frame)
        if self.checksum is not None:
            self.checksum.check(frame, "frame")
        elif frame.checksum.stop:
            raise ValueError("`frame` has bytes CS, `checksum` must describe them")
        elif sum(byte is not None for byte in frame.fixed) < MIN_FIXED_BYTES:
            raise ValueError(f"a frame without a checksum needs {MIN_FIXED_BYTES} fixed bytes to be known by")
        for channel in self.channels:
            if channel.at + channel.length > len(frame.fixed):
                raise ValueError(f"channel {channel.name} ends beyond the frame's {len(frame.fixed)} bytes")
        for error in self.errors:
            short = FrameLayout.of(error.frame).fixed
            if len(short) > len(frame.fixed):
                raise ValueError("an error's frame must not be longer than the reply")
            if all(None in (a, b) or a == b for a, b in zip(short, frame.fixed, strict=False)):
                raise ValueError(f"error {error.frame!r} could be the beginning of a reply")
        return self

    @property
    def request(self) -> bytes:
        """The request including its checksum."""
        if self.out_checksum is None:
            return bytes.fromhex(self.out)
        frame = FrameLayout.of(self.out)
        request = bytes(byte or 0 for byte in frame.fixed)
        checksum = self.out_checksum.of(request, frame.checksum)
        return request[: frame.checksum.start] + checksum + request[frame.checksum.stop :]


class SerialFrame(Gauge[ByteLine]):
    """One described device."""

    Options: ClassVar[type[GaugeOptions]] = SerialFrameOptions
    line_kind = "bytes"
    range_option: ClassVar[str] = RANGE_OPTION
    integrity: ClassVar[Literal["checksum", "format"]] = "checksum"
    sample_options: ClassVar[Mapping[str, Any] | None] = {
        "out": "02 41 00 43",
        "frame": "02 41 .. .. .. .. .. .. CS CS",
        "checksum": {"kind": "crc16_modbus"},
        "channels": [
            {
                "name": "a",
                "at": 2,
                "type": "int32",
                "byte_order": "big",
                "unit": "nm",
                "invalid": {2147483647: "sensor_fault", -2147483648: "under_range"},
            },
            {
                "name": "b",
                "at": 6,
                "type": "int16",
                "unit": "um",
                "scale": 0.1,
                "invalid": {-32768: "sensor_fault", 32767: "over_range"},
            },
        ],
    }

    def __init__(self, options: SerialFrameOptions) -> None:
        super().__init__(options)
        self._protocol = options
        self._request = options.request
        self._frame = FrameLayout.of(options.frame)
        self._errors = sorted(
            ((FrameLayout.of(e.frame), e) for e in options.errors), key=lambda pair: len(pair[0].fixed)
        )
        self._channels = tuple(channel.channel for channel in options.channels)

    @property
    def channels(self) -> Sequence[Channel]:
        return self._channels

    def doubts(self) -> Iterable[OptionDoubt]:
        return doubts(self._protocol.channels, self.range_option)

    @property
    def reply_identity(self) -> str | None:
        return self._frame.beginning.decode("latin-1") or None

    @property
    def line_needs(self) -> Mapping[Literal["dtr", "rts"], bool]:
        return self._protocol.line_needs

    @property
    def serial_signals(self) -> Sequence[Literal["DTR", "break"]]:
        return () if self._protocol.break_s is None else ("break",)

    def traffic(self) -> Sequence[tuple[int, int]]:
        return [(len(self._request), len(self._frame.fixed))]

    def read(self, line: ByteLine) -> Sequence[Reading]:
        """Raises LineFault: as the line does, CRC for a wrong checksum, MISMATCH for other fixed bytes."""
        time_s = ask(line, self._protocol, self._request)
        data, error = self._receive(line)
        nothing_behind(line, self._protocol, data)
        if error is not None:
            detail = f"{data.hex(' ')}: {error.says}" if error.says else data.hex(" ")
            return [bad(time_s, Quality(error.quality), detail)] * len(self._channels)
        place = self._frame.checksum
        if self._protocol.checksum and data[place] != self._protocol.checksum.of(data, place):
            raise LineFault(Quality.CRC, data.hex(" "))
        if not self._frame.fits(data):
            raise LineFault(Quality.MISMATCH, f"{data.hex(' ')}, expected {self._protocol.frame}")
        return [_reading(channel, data, time_s) for channel in self._protocol.channels]

    def _rest(self, line: ByteLine, count: int, so_far: bytes) -> bytes:
        gap_s = self._protocol.gap_timeout_s
        return following(line, count if gap_s is None else 1, gap_s, so_far)

    def _receive(self, line: ByteLine) -> tuple[bytes, ErrorFrame | None]:
        """The reply, and its error, if it is one."""
        data = b""
        for length in sorted({len(frame.fixed) for frame in (self._frame, *(frame for frame, _ in self._errors))}):
            if not data:
                data = receive(line, self._protocol, length)
            while len(data) < length:
                data += self._rest(line, length - len(data), data)
            for frame, error in self._errors:
                if frame.fits(data):
                    return data, error
        return data, None


def _reading(channel: FrameChannel, data: bytes, time_s: float) -> Reading:
    number = channel.number(data)
    if number in channel.invalid:
        return bad(time_s, Quality(channel.invalid[number]), f"number {number:g}")
    if stands_for_no_number(number):
        return bad(time_s, Quality.NOT_FINITE, f"{number:g} stands for no number")
    if channel.type in _FLOATS and not_measured(number):
        return bad(time_s, Quality.MISMATCH, f"byte order? {number:.4g} is no measurement")
    return channel.reading(number, time_s, full_scale=channel.full_scale)
