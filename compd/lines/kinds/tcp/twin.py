"""A simulated line of bytes over TCP."""

from compd.twins.byte_devices import byte_listener
from compd.twins.polled_twin import PolledTwin
from compd.twins.wire_ends import tcp_end

TWIN = PolledTwin(end=tcp_end, listener=byte_listener)
