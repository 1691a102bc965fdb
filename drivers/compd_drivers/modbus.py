"""Generic Modbus gauge: a register map in the configuration; Modbus RTU, TCP and RTU over TCP.

Source of the protocol: Modbus Application Protocol V1.1b3, functions 3 and 4 (M). No comparator with a complete
public register map was found, so the map is yours, out of your module's manual; for example (M: manual, C: code)

    ICP DAS M-7017C (M)       function 4, address 0-7, int16
    Advantech ADAM-4117 (C)   function 3, address 0-7, uint16, invalid [65535], scale (max - min) / 65535
    Moxa ioLogik E1240 (M)    function 4, address 8-23, float32, status {address: 60 ...}: 0 ok, 1 burn-out,
                              2 over, 3 under
    R4DCB08 (C)               function 3, address 0-7, int16, scale 0.1, unit degC, invalid [-32768]

These four are presets too (icpdas_m7017c, adam_4017p, moxa_e1240, r4dcb08). A module that sends V or mA gets a
`linearisation` per channel: `scale` and `offset` lead to V or mA, the linearisation from there to `unit`.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self

from pydantic import Field, model_validator

from compd.gauge import Channel, Gauge, GaugeOptions, Quality, Reading, RegisterLine, Unit, bad, good
from compd_drivers.linearisation import Linearisation
from compd_drivers.measured import DescriptionSection, not_measured, repeated

Address = Annotated[int, Field(ge=0, le=0xFFFF)]
Number = Annotated[float, Field(allow_inf_nan=False)]
Function = Literal[3, 4]
RegisterType = Literal["int16", "uint16", "int32", "uint32", "float32"]
# One less than Modbus allows: the RTU master wants to ask for one more.
MOST_REGISTERS = 124

_FORMATS = {"int16": ">h", "uint16": ">H", "int32": ">i", "uint32": ">I", "float32": ">f"}


class Status(DescriptionSection):
    """A register that says whether a channel's value counts."""

    address: Address = Field(description="of the status register; read by the channel's own function")
    ok: tuple[int, ...] = Field(default=(0,), description="values that mean: good")
    over_range: tuple[int, ...] = Field(default=(), description="values that mean: over range")
    under_range: tuple[int, ...] = Field(default=(), description="values that mean: under range")


class ModbusChannel(DescriptionSection):
    """One value in the register map: value = raw x scale + offset."""

    name: str = Field(pattern=r"^[A-Za-z0-9_]+$", description="name of the channel")
    function: Function = Field(description="3: holding registers, 4: input registers")
    address: Address = Field(description="first register as on the wire, from 0")
    type: RegisterType = Field(description="how the number is stored")
    word_order: Literal["high_first", "low_first"] = Field(
        default="high_first", description="of a number in two registers"
    )
    byte_order: Literal["big", "little"] = Field(default="big", description="inside a register; big is Modbus's own")
    scale: Number = Field(default=1.0, description="unit (or V, mA) per count; negative turns the sign")
    offset: Number = Field(default=0.0, description="in the channel's unit")
    unit: Unit = Field(description="of the value after scale, offset and linearisation")
    invalid: tuple[Number, ...] = Field(default=(), description="raw values that mean: no sensor, broken wire")
    over_range: tuple[Number, ...] = Field(default=(), description="raw values that mean: at or above full scale")
    under_range: tuple[Number, ...] = Field(default=(), description="raw values that mean: at or below zero scale")
    linearisation: Linearisation | None = Field(default=None, description="from V or mA, after scale, to `unit`")
    lowest: Number | None = Field(default=None, description="smallest value that the sensor can deliver, in its unit")
    highest: Number | None = Field(default=None, description="greatest value that the sensor can deliver, in its unit")
    status: Status | None = Field(default=None, description="register that says whether the value counts")

    @property
    def length(self) -> int:
        """Registers that the number takes."""
        return 1 if self.type in {"int16", "uint16"} else 2

    @model_validator(mode="after")
    def _ends_inside(self) -> Self:
        if self.address + self.length > 0x10000:
            raise ValueError("ends beyond register 65535")
        return self


class ModbusOptions(GaugeOptions):
    """Options of a Modbus gauge."""

    unit: int = Field(ge=0, le=247, description="slave address (0 only behind some TCP devices)")
    channels: tuple[ModbusChannel, ...] = Field(min_length=1, description="the register map")

    @model_validator(mode="after")
    def _names_differ(self) -> Self:
        if doubled := repeated([channel.name for channel in self.channels]):
            raise ValueError(f"channel named twice: {doubled}")
        return self


class RegisterBlock(NamedTuple):
    """Adjacent registers that are read together."""

    function: int
    address: int
    length: int


class _RegisterPlace(NamedTuple):
    """Where a channel's registers are in the blocks."""

    block: int
    first: int


class Modbus(Gauge[RegisterLine]):
    """One slave; as few reads as its map allows, each channel with the time of its own read."""

    Options: ClassVar[type[GaugeOptions]] = ModbusOptions
    line_kind = "registers"
    sample_options: ClassVar[Mapping[str, Any]] = {
        "unit": 1,
        "channels": [
            {"name": "a", "function": 4, "address": 0, "type": "float32", "unit": "mm"},
            {
                "name": "b",
                "function": 4,
                "address": 2,
                "type": "int16",
                "scale": 1e-4,
                "unit": "mm",
                "lowest": -3.2,
                "highest": 3.2,
            },
            {
                "name": "c",
                "function": 3,
                "address": 8,
                "type": "int32",
                "word_order": "low_first",
                "scale": 1e-6,
                "unit": "mm",
                "invalid": [2147483647],
            },
        ],
    }

    def __init__(self, options: ModbusOptions) -> None:
        super().__init__(options)
        self._unit = options.unit
        self._map = options.channels
        self._channels = tuple(Channel(channel.name, channel.unit) for channel in options.channels)
        spans = [(c.function, c.address, c.length) for c in self._map]
        spans += [(c.function, c.status.address, 1) for c in self._map if c.status]
        self.blocks = blocks(spans)
        self._values = [self._place(c.function, c.address, c.length) for c in self._map]
        self._statuses = [self._place(c.function, c.status.address, 1) if c.status else None for c in self._map]

    @property
    def channels(self) -> Sequence[Channel]:
        return self._channels

    def traffic(self) -> Sequence[tuple[int, int]]:
        return [(8, 5 + 2 * block.length) for block in self.blocks]

    def read(self, line: RegisterLine) -> Sequence[Reading]:
        """Raises LineFault as the line does: a block that cannot be read leaves the whole gauge without values."""
        replies = [line.read_registers(self._unit, *block) for block in self.blocks]
        readings = []
        for channel, value, status in zip(self._map, self._values, self._statuses, strict=True):
            registers, time_s = replies[value.block]
            status_value = replies[status.block].registers[status.first] if status else None
            readings.append(
                _reading(channel, registers[value.first : value.first + channel.length], status_value, time_s)
            )
        return readings

    def _place(self, function: int, address: int, length: int) -> _RegisterPlace:
        return next(
            _RegisterPlace(i, address - block.address)
            for i, block in enumerate(self.blocks)
            if block.function == function and 0 <= address - block.address <= block.length - length
        )


def blocks(spans: Sequence[tuple[int, int, int]]) -> tuple[RegisterBlock, ...]:
    """(function, address, registers) of every number -> reads that cover adjacent registers and split no number."""
    reads: list[RegisterBlock] = []
    for function, address, length in sorted(spans):
        end = address + length
        if reads and reads[-1].function == function and address <= reads[-1].address + reads[-1].length:
            last = reads[-1]
            covered = max(end - last.address, last.length)
            if covered <= MOST_REGISTERS:
                reads[-1] = RegisterBlock(function, last.address, covered)
                continue
        reads.append(RegisterBlock(function, address, length))
    return tuple(reads)


def _reading(channel: ModbusChannel, registers: tuple[int, ...], status_value: int | None, time_s: float) -> Reading:
    if channel.status is not None and status_value is not None and status_value not in channel.status.ok:
        return bad(time_s, _status_quality(channel.status, status_value), f"status {status_value}")
    raw = decode(channel, registers)
    if raw in channel.invalid:
        return bad(time_s, Quality.SENSOR_FAULT, f"raw value {raw:g}")
    if raw in channel.over_range:
        return bad(time_s, Quality.OVER_RANGE, f"raw value {raw:g}")
    if raw in channel.under_range:
        return bad(time_s, Quality.UNDER_RANGE, f"raw value {raw:g}")
    if channel.type == "float32" and not_measured(raw):
        return bad(time_s, Quality.MISMATCH, _other_orders(channel, registers, raw))
    value = raw * channel.scale + channel.offset
    reading = channel.linearisation.reading(value, time_s) if channel.linearisation else good(value, time_s)
    if channel.highest is not None and reading.value > channel.highest:
        return bad(time_s, Quality.OVER_RANGE, f"{reading.value:g} {channel.unit}")
    if channel.lowest is not None and reading.value < channel.lowest:
        return bad(time_s, Quality.UNDER_RANGE, f"{reading.value:g} {channel.unit}")
    return reading


def _status_quality(status: Status, status_value: int) -> Quality:
    if status_value in status.over_range:
        return Quality.OVER_RANGE
    return Quality.UNDER_RANGE if status_value in status.under_range else Quality.SENSOR_FAULT


def _other_orders(channel: ModbusChannel, registers: Sequence[int], raw: float) -> str:
    """What the same registers are in the other orders of bytes and words, for a person who knows the value."""
    orders = [
        channel.model_copy(update={"word_order": words, "byte_order": inside})
        for words in ("high_first", "low_first")
        for inside in ("big", "little")
    ]
    others = ", ".join(
        f"{decode(other, registers):.7g} ({other.word_order}, {other.byte_order})"
        for other in orders
        if other != channel
    )
    return f"byte order? {raw:.4g} ({channel.word_order}, {channel.byte_order}) is no measurement; others: {others}"


def decode(channel: ModbusChannel, registers: Sequence[int]) -> float:
    """The raw number in a channel's registers (unsigned, as on the wire)."""
    words = registers if channel.word_order == "high_first" else registers[::-1]
    data = b"".join(word.to_bytes(2, channel.byte_order) for word in words)
    (raw,) = struct.unpack(_FORMATS[channel.type], data)
    return float(raw)
