"""Generic Modbus gauge: a register map in the configuration; Modbus RTU, ASCII and TCP.

Source of the protocol: Modbus Application Protocol V1.1b3, functions 1 to 6 and 16 (M). No comparator with a complete
public register map was found, so the map is yours, out of your module's manual; for example (M: manual, C: code)

    ICP DAS M-7017C (M)       function 4, address 0-7, int16
    Advantech ADAM-4117 (C)   function 3, address 0-7, uint16, invalid [65535], scale (max - min) / 65535
    Moxa ioLogik E1240 (M)    function 4, address 8-23, float32, status {address: 60 ...}: 0 ok, 1 burn-out,
                              2 over, 3 under
    R4DCB08 (C)               function 3, address 0-7, int16, scale 0.1, unit degC, invalid [-32768]

A number may be part of its registers: a Beckhoff IP5209 (M) has its status in the low byte of the first register, and
the 24 bits of its counter in the other three bytes
    {name: position, function: 3, address: 0, type: uint24, word_order: low_first, unit: mm, scale: 0.001,
     lowest: -1, highest: 300, status: {address: 0, mask: MASK}}
and its manual says which bits of the status mean an error: they are the mask.
`write_first` switches the unit or starts the device, `write_before_poll` latches; `identity` makes sure that it is this
device. What is written is confirmed by the device, or the poll has failed.

The four modules are presets too (icpdas_m7017c, adam_4017p, moxa_e1240, r4dcb08). A module that sends V or mA gets a
`linearisation` per channel: `scale` and `offset` lead to V or mA, the linearisation from there to `unit`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, ClassVar, NamedTuple

from compd.gauge import (
    Channel,
    Gauge,
    GaugeOptions,
    LineFault,
    OptionDoubt,
    Quality,
    Reading,
    RegisterLine,
    RegisterReply,
    bad,
    good,
    stands_for_no_number,
)
from compd_drivers.measured import not_measured
from compd_drivers.modbus_description import ModbusChannel, ModbusOptions, ModbusWrite, Status
from compd_drivers.modbus_doubts import RANGE, doubts
from compd_drivers.modbus_number import FLOATS, READ_BITS, decode
from compd_drivers.no_number import unless_missing

# Most registers of a read: fewer than Modbus allows, as a serial master asks for one more.
MAX_REGISTERS, MAX_BITS = 124, 1992


class RegisterBlock(NamedTuple):
    """Adjacent registers read together."""

    function: int
    address: int
    length: int


class _RegisterPlace(NamedTuple):
    """Position of a channel's registers in the blocks."""

    block: int
    first: int


class Modbus(Gauge[RegisterLine]):
    """One slave; as few reads as its map allows, each channel with the time of its own read."""

    Options: ClassVar[type[GaugeOptions]] = ModbusOptions
    line_kind = "registers"
    range_option: ClassVar[str | None] = None  # of a preset, which has its own keys
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
                "under_range": [-2147483648],
            },
        ],
    }

    def __init__(self, options: ModbusOptions) -> None:
        super().__init__(options)
        self._description = options
        self._unit = options.unit
        self._map = options.channels
        self._channels = tuple(Channel(channel.name, channel.unit) for channel in options.channels)
        spans: list[tuple[int, int, int]] = [(c.function, c.address, c.length) for c in self._map]
        spans += [(c.status_function, c.status.address, 1) for c in self._map if c.status]
        self.blocks = blocks(spans)
        self._values = [self._place(c.function, c.address, c.length) for c in self._map]
        self._statuses = [self._place(c.status_function, c.status.address, 1) if c.status else None for c in self._map]
        self._ready_on: RegisterLine | None = None  # the connection on which it is known and started

    @property
    def channels(self) -> Sequence[Channel]:
        return self._channels

    def doubts(self) -> Iterable[OptionDoubt]:
        return doubts(self._map, RANGE if self.range_option is None else "")

    def traffic(self) -> Sequence[tuple[int, int]]:
        writes = [
            (8 if len(write.values) == 1 else 9 + 2 * len(write.values), 0 if self._unit_of(write) == 0 else 8)
            for write in self._description.write_before_poll
        ]
        return writes + [(8, 5 + _data_bytes(block)) for block in self.blocks]

    def read(self, line: RegisterLine) -> Sequence[Reading]:
        """Raises LineFault as the line does: an unreadable block leaves the whole gauge without values.

        MISMATCH for another device than the one that the description names.
        """
        if self._ready_on is not line:
            self._begin(line)
        self._ready_on = None  # until all has succeeded
        latched_s = [self._write(line, write) for write in self._description.write_before_poll]
        replies = [self._read_block(line, block) for block in self.blocks]
        self._ready_on = line
        readings = []
        for channel, value, status in zip(self._map, self._values, self._statuses, strict=True):
            registers, read_s = replies[value.block]
            status_value = replies[status.block].registers[status.first] if status else None
            time_s = latched_s[-1] if latched_s else read_s
            readings.append(
                _reading(channel, registers[value.first : value.first + channel.length], status_value, time_s)
            )
        return readings

    def _begin(self, line: RegisterLine) -> None:
        """Check the device's identity, then write its settings. Raises LineFault."""
        if identity := self._description.identity:
            place = (self._unit, identity.function, identity.address)
            registers, _ = line.read_registers(*place, len(identity.equals))
            if registers != identity.equals:
                text = f"registers from {identity.address} are {list(registers)}, not {list(identity.equals)}"
                raise LineFault(Quality.MISMATCH, f"another device than `identity` says: {text}")
        for write in self._description.write_first:
            self._write(line, write)

    def _unit_of(self, write: ModbusWrite) -> int:
        return self._unit if write.unit is None else write.unit

    def _write(self, line: RegisterLine, write: ModbusWrite) -> float:
        return line.write(self._unit_of(write), write.function, write.address, write.values, write.settle_s)

    def _read_block(self, line: RegisterLine, block: RegisterBlock) -> RegisterReply:
        read = line.read_bits if block.function in READ_BITS else line.read_registers
        return read(self._unit, *block)

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
            if covered <= (MAX_BITS if function in READ_BITS else MAX_REGISTERS):
                reads[-1] = RegisterBlock(function, last.address, covered)
                continue
        reads.append(RegisterBlock(function, address, length))
    return tuple(reads)


def _data_bytes(block: RegisterBlock) -> int:
    """Bytes of data in the reply."""
    return -(-block.length // 8) if block.function in READ_BITS else 2 * block.length


def _reading(channel: ModbusChannel, registers: tuple[int, ...], status_value: int | None, time_s: float) -> Reading:
    if channel.status is not None and status_value is not None:
        if channel.status.mask is not None:
            status_value &= channel.status.mask
        if status_value not in channel.status.ok:
            return bad(time_s, _status_quality(channel.status, status_value), f"status {status_value}")
    raw = decode(channel, registers)
    if raw is None:
        digits = " ".join(f"{register:04X}" for register in registers)
        return bad(time_s, Quality.MISMATCH, f"{digits} are no decimal digits, see `type` and `mask`")
    if raw in channel.invalid:
        return bad(time_s, Quality.SENSOR_FAULT, f"raw value {raw:g}")
    if raw in channel.over_range:
        return bad(time_s, Quality.OVER_RANGE, f"raw value {raw:g}")
    if raw in channel.under_range:
        return bad(time_s, Quality.UNDER_RANGE, f"raw value {raw:g}")
    if stands_for_no_number(raw):
        return bad(time_s, Quality.NOT_FINITE, f"{raw:g} stands for no number")
    if channel.type in FLOATS and not_measured(raw):
        return bad(time_s, Quality.MISMATCH, _other_orders(channel, registers, raw))
    value = raw * channel.scale + channel.offset
    reading = channel.linearisation.reading(value, time_s) if channel.linearisation else good(value, time_s)
    if channel.highest is not None and reading.value > channel.highest:
        return bad(time_s, Quality.OVER_RANGE, f"{reading.value:g} {channel.unit}")
    if channel.lowest is not None and reading.value < channel.lowest:
        return bad(time_s, Quality.UNDER_RANGE, f"{reading.value:g} {channel.unit}")
    return reading if channel.states_range else unless_missing(reading, raw, channel.full_scale, RANGE)


def _status_quality(status: Status, status_value: int) -> Quality:
    if status_value in status.over_range:
        return Quality.OVER_RANGE
    return Quality.UNDER_RANGE if status_value in status.under_range else Quality.SENSOR_FAULT


def _other_orders(channel: ModbusChannel, registers: Sequence[int], raw: float) -> str:
    """The same registers in other orders of bytes and words, for a person who knows the value."""
    orders = [
        channel.model_copy(update={"word_order": words, "byte_order": inside})
        for words in ("high_first", "low_first")
        for inside in ("big", "little")
    ]
    others = ", ".join(
        f"{decode(other, registers) or 0.0:.7g} ({other.word_order}, {other.byte_order})"
        for other in orders
        if other != channel
    )
    return f"byte order? {raw:.4g} ({channel.word_order}, {channel.byte_order}) is no measurement; others: {others}"
