"""A simulated line of bytes over TCP."""

from compd.lines.twins.byte_devices import byte_listener
from compd.lines.twins.polled_twin import PolledTwin
from compd.lines.twins.wire_ends import tcp_end

TWIN = PolledTwin(end=tcp_end, listener=byte_listener)
