"""Simulated Modbus TCP units."""

from __future__ import annotations

from functools import partial

from compd.twins.modbus_slaves import register_listener
from compd.twins.polled_twin import DAMAGED_BIT, DAMAGES, PolledTwin
from compd.twins.wire_ends import tcp_end


def _garble_header(reply: bytes) -> bytes:
    """Damage the frame's protocol number; TCP's own checksum protects the rest against noise."""
    return reply[:2] + bytes([reply[2] ^ DAMAGED_BIT]) + reply[3:]


def _other_unit(reply: bytes) -> bytes:
    return reply[:6] + bytes([reply[6] % 247 + 1]) + reply[7:]


TWIN = PolledTwin(
    end=tcp_end,
    listener=partial(register_listener, over_tcp=True),
    damages={**DAMAGES, "garble": _garble_header, "wrong unit": _other_unit},
)
