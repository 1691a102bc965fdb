"""What the process of the service does: serve the clients, take machine zero, pass the processes' logs on."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass

import structlog

from compd.live.loop import Setpoint
from compd.live.memory import Control, Phase
from compd.live.processes.log_relay import LogRelay
from compd.live.service import LastReadings, ModelSwitch, Publisher, Requests, UdpSender, ZeroCapture
from compd.live.system import System
from compd.setpoint_states import State

# Characters. A reason that names every gauge of a machine has thousands; the log has it whole.
_MAX_HEADLINE = 500

_log = structlog.get_logger()


class StateLog:
    """Reports every change of the machine's state to the log and the service manager."""

    def __init__(self, control: Control) -> None:
        self._control = control
        self._state: State | None = None

    def note(self, setpoint: Setpoint) -> None:
        """Take a setpoint; called on the publisher's thread."""
        if setpoint.state is self._state:
            return
        self._state = setpoint.state
        log = _log.info if setpoint.state.valid else _log.warning
        log("state", state=setpoint.state.value, reason=setpoint.reason, mode=setpoint.mode.value)
        headline = f"{setpoint.state}: {setpoint.reason}" if setpoint.reason else str(setpoint.state)
        self._control.headline.write(headline[:_MAX_HEADLINE])
        self._control.wake_supervisor()


@dataclass(frozen=True)
class ServiceProcess:
    """The parts of the daemon that serve, all made before the process was forked.

    logs : descriptors from which the other processes' output is read, by their name.
    priority : for the thread that serves, below the loop's; 0 for none.
    """

    publisher: Publisher
    requests: Requests
    zero_capture: ZeroCapture
    last_readings: LastReadings
    model_switch: ModelSwitch
    packets: UdpSender | None
    control: Control
    system: System
    logs: Mapping[str, int]
    priority: int

    def run(self) -> None:
        """Serve until the daemon stops."""
        journal = self.system.journal()
        relay = LogRelay(self.logs, _write if journal is None else journal.write, self.system)
        relay.start()
        self.last_readings.start()
        privileges = self.system.privileges
        privileges.shorten_switch_interval()
        privileges.sharpen_timers()
        priority = privileges.rationed_priority(self.priority, self.system)

        def each_round() -> None:
            self.control.beat_service()
            self.model_switch.look()
            priority.look()

        self.publisher.run(self.requests, lambda: self.control.phase != Phase.STOPPING, each_round)
        self.publisher.end(self.control.ending())
        self.zero_capture.stop()
        self.last_readings.stop()
        relay.stop()


def _write(line: str) -> None:
    sys.stderr.write(line)
    sys.stderr.flush()
