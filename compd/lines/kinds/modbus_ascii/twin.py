"""Simulated Modbus ASCII slaves."""

from __future__ import annotations

from functools import partial

from pymodbus.framer.ascii import FramerAscii

from compd.twins.modbus_slaves import register_listener
from compd.twins.polled_twin import DAMAGES, PolledTwin
from compd.twins.serial_end import serial_character_s, serial_end


def _other_unit(reply: bytes) -> bytes:
    frame = bytearray(bytes.fromhex(reply[1:-4].decode()))
    frame[0] = frame[0] % 247 + 1
    return b":" + (bytes(frame) + bytes([FramerAscii.compute_LRC(bytes(frame))])).hex().upper().encode() + b"\r\n"


TWIN = PolledTwin(
    end=serial_end,
    listener=partial(register_listener, as_text=True),
    damages={**DAMAGES, "wrong unit": _other_unit},
    character_s=serial_character_s,
)
