"""Simulated Modbus RTU slaves."""

from __future__ import annotations

from pymodbus.framer.rtu import FramerRTU

from compd.twins.modbus_slaves import register_listener
from compd.twins.polled_twin import DAMAGES, PolledTwin
from compd.twins.serial_end import serial_character_s, serial_end


def _other_unit(reply: bytes) -> bytes:
    frame = bytes([reply[0] % 247 + 1]) + reply[1:-2]
    return frame + FramerRTU.compute_CRC(frame).to_bytes(2, "big")


TWIN = PolledTwin(
    end=serial_end,
    listener=register_listener,
    damages={**DAMAGES, "wrong unit": _other_unit},
    character_s=serial_character_s,
)
