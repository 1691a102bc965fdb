"""A simulated line of bytes on a serial port."""

from compd.twins import PolledTwin, byte_listener, serial_character_s, serial_end

TWIN = PolledTwin(end=serial_end, listener=byte_listener, character_s=serial_character_s)
