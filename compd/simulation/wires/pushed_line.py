"""A simulated line whose devices speak by themselves: a thread that sends what they say, and the line's faults."""

from __future__ import annotations

import math
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from compd.clock import Clock, MonotonicClock
from compd.simulation.wires.device import SimulatedPushedDevice

Port = str | tuple[str, int]

SILENT, UNPLUGGED = "silent", "unplugged"
# How often a device speaks that does not say it itself, s.
PERIOD_S = 0.05


class SimulatedPushedLine(ABC):
    """One configured line with its devices, served by a thread of its own.

    fault : of the line, or None. It is followed before the next value is sent.
    """

    faults: ClassVar[tuple[str, ...]] = (SILENT, UNPLUGGED)

    def __init__(self, name: str, devices: Sequence[SimulatedPushedDevice], clock: Clock | None = None) -> None:
        self._devices = devices
        self._clock = clock or MonotonicClock()
        self._period_s = min((device.period_s or PERIOD_S for device in devices), default=PERIOD_S)
        self._fault: str | None = None
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"simulated {name}", daemon=True)

    def start(self) -> Port:
        """Connect or listen, and speak. Returns the port for the daemon. Raises CompdError where that cannot be."""
        self.plug_in()
        self._thread.start()
        return self.port

    def stop(self) -> None:
        """Fall silent, and close what is open."""
        self._stop.set()
        if self._thread.ident is not None:
            self._thread.join()

    @property
    def fault(self) -> str | None:
        """The line's fault, or None."""
        return self._fault

    @fault.setter
    def fault(self, fault: str | None) -> None:
        if fault is not None and fault not in self.faults:
            raise ValueError(f"no fault {fault!r} on this line: {', '.join(self.faults)}")
        self._fault = fault

    @property
    @abstractmethod
    def port(self) -> Port:
        """The daemon's port: (host, port), or an endpoint."""

    @abstractmethod
    def plug_in(self) -> None:
        """Connect, or listen."""

    @abstractmethod
    def pull_out(self) -> None:
        """Close every connection."""

    @abstractmethod
    def send(self, values: Mapping[str, Any], utc_s: float) -> None:
        """Send values by topic or node, as `SimulatedPushedDevice.say` gives them."""

    def _run(self) -> None:
        connected = True
        while not self._clock.wait(self._stop, self._period_s):
            if (self._fault == UNPLUGGED) is connected:
                (self.pull_out if connected else self.plug_in)()
                connected = not connected
            if self._fault is None:
                utc_s = time.time()
                for device in self._devices:
                    self.send(device.say(utc_s), utc_s)
        if connected:
            self.pull_out()


def is_off(value: Any) -> bool:
    """Whether a sensor, or one of several, is off."""
    return any(math.isnan(number) for number in (value if isinstance(value, list) else [value]))
