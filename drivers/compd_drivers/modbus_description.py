"""Options of a described Modbus gauge in the configuration, and their checks."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from compd.gauge import GaugeOptions, Unit
from compd_drivers.linearisation import Linearisation
from compd_drivers.measured import DescriptionSection, repeated
from compd_drivers.modbus_number import READ_BITS, Mask, RegisterNumber

Address = Annotated[int, Field(ge=0, le=0xFFFF)]
Number = Annotated[float, Field(allow_inf_nan=False)]
Register = Annotated[int, Field(ge=0, le=0xFFFF)]
Function = Literal[1, 2, 3, 4]
WRITE_COIL, WRITE_REGISTERS = 5, 16
MAX_WRITTEN = 123  # registers of one request by function 16
BROADCAST = 0


class Status(DescriptionSection):
    """A register, or bits of one, with the validity of a channel's value."""

    address: Address = Field(description="of the status register, or bit")
    function: Function | None = Field(default=None, description="by which it is read; the channel's own if left out")
    mask: Mask | None = Field(default=None, description="the bits that count; all if left out. They are not shifted")
    ok: tuple[int, ...] = Field(default=(0,), description="values that mean: good")
    over_range: tuple[int, ...] = Field(default=(), description="values that mean: over range")
    under_range: tuple[int, ...] = Field(default=(), description="values that mean: under range")

    @model_validator(mode="after")
    def _values_fit(self) -> Self:
        mask = 0xFFFF if self.mask is None else self.mask
        for value in (*self.ok, *self.over_range, *self.under_range):
            if value & mask != value:
                raise ValueError(f"value {value:#x} has bits that `mask` {mask:#x} leaves out: it never comes")
        return self


class ModbusChannel(RegisterNumber):
    """One value in the register map: value = raw x scale + offset."""

    name: str = Field(pattern=r"^[A-Za-z0-9_]+$", description="name of the channel")
    function: Function = Field(description="1: coils, 2: discrete inputs, 3: holding registers, 4: input registers")
    address: Address = Field(description="first register, or bit, as on the wire, from 0")
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

    @model_validator(mode="after")
    def _ends_inside(self) -> Self:
        if (self.type == "bit") != (self.function in READ_BITS):
            raise ValueError("functions 1 and 2 read type bit, 3 and 4 all others")
        if self.address + self.length > 0x10000:
            raise ValueError("ends beyond register 65535")
        return self

    @property
    def states_range(self) -> bool:
        """Whether the values are limited on both sides, by a range or by the ends of the linearisation."""
        return self.linearisation is not None or None not in (self.lowest, self.highest)

    @property
    def status_function(self) -> int:
        """The function for reading the status."""
        return self.status.function if self.status and self.status.function else self.function


class ModbusWrite(DescriptionSection):
    """A value written to the device."""

    function: Literal[5, 6, 16] = Field(description="5: one coil, 6: one register, 16: several registers")
    address: Address = Field(description="of the coil or the first register, from 0")
    values: tuple[Register, ...] = Field(
        min_length=1, max_length=MAX_WRITTEN, description="what is written; for a coil 0 or 1"
    )
    unit: Annotated[int, Field(ge=0, le=247)] | None = Field(
        default=None, description="to whom: the gauge's own if left out; 0 on a serial line: all, without an answer"
    )
    settle_s: Annotated[float, Field(ge=0, le=10, allow_inf_nan=False)] = Field(
        default=0.0, description="how long the device is busy with it: the next request waits for this time"
    )

    @model_validator(mode="after")
    def _fits_its_function(self) -> Self:
        if self.function != WRITE_REGISTERS and len(self.values) != 1:
            raise ValueError(f"function {self.function} writes one value")
        if self.function == WRITE_COIL and self.values[0] > 1:
            raise ValueError("a coil is 0 or 1")
        if self.unit == BROADCAST and self.settle_s == 0:
            raise ValueError(
                "unit 0 gives no answer: `settle_s` says when the devices listen again, 0.1 to 0.2 s as a rule"
            )
        return self


class Identity(DescriptionSection):
    """Registers that identify the device: a serial number, a type."""

    function: Literal[3, 4] = Field(description="3: holding registers, 4: input registers")
    address: Address = Field(description="of the first of them, from 0")
    equals: tuple[Register, ...] = Field(min_length=1, max_length=MAX_WRITTEN, description="what they must hold")


class ModbusOptions(GaugeOptions):
    """Options of a Modbus gauge."""

    unit: int = Field(ge=0, le=247, description="slave address (0 only behind some TCP devices)")
    channels: tuple[ModbusChannel, ...] = Field(min_length=1, description="the register map")
    identity: Identity | None = Field(
        default=None, description="read first on a connection and after every fault: another device has no values"
    )
    write_first: tuple[ModbusWrite, ...] = Field(
        default=(), description="written before the first poll on a connection and after every fault: a unit, a start"
    )
    write_before_poll: tuple[ModbusWrite, ...] = Field(
        default=(), description="written before every poll: a latch. The readings have the time of the last of them"
    )

    @model_validator(mode="after")
    def _names_differ(self) -> Self:
        if doubled := repeated([channel.name for channel in self.channels]):
            raise ValueError(f"channel named twice: {doubled}")
        return self
