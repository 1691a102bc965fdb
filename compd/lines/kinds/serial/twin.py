"""A simulated line of bytes on a serial port."""

from compd.twins.byte_devices import byte_listener
from compd.twins.polled_twin import PolledTwin
from compd.twins.serial_end import serial_character_s, serial_end

TWIN = PolledTwin(end=serial_end, listener=byte_listener, character_s=serial_character_s)
