"""The binary setpoint over UDP, for controllers that want one packet of one size per cycle."""

from __future__ import annotations

from typing import Any

from compd.errors import DaemonError
from compd.live.loop import Setpoint
from compd.live.system import System
from compd.operation_settings import UdpTarget


class UdpSender:
    """Sends the packet of every setpoint to one address, on the publisher's thread.

    A packet that the system does not take at once is dropped and counted.
    """

    def __init__(self, target: UdpTarget, system: System) -> None:
        """Raises DaemonError for an unknown host."""
        try:
            self._datagrams = system.datagrams(target.host, target.port)
        except OSError as error:
            raise DaemonError.of(
                "sockets.udp.host",
                f"has no address: {error.strerror}",
                value=target.host,
                next_step="write the controller's IP address",
            ) from error
        self.sent = 0
        self.dropped = 0

    def deliver(self, setpoint: Setpoint) -> None:
        """Send the packet of a setpoint, without waiting."""
        try:
            self._datagrams.send(setpoint.packet)
        except OSError:
            self.dropped += 1
        else:
            self.sent += 1

    def summary(self) -> dict[str, Any]:
        """How many packets were sent and dropped, for STATUS."""
        return {"packets_sent": self.sent, "packets_dropped": self.dropped}

    def close(self) -> None:
        """Close the socket."""
        self._datagrams.close()
