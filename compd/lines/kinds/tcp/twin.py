"""A simulated line of bytes over TCP."""

from compd.twins import PolledTwin, byte_listener, tcp_end

TWIN = PolledTwin(end=tcp_end, listener=byte_listener)
