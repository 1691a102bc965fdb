"""A simulated line whose devices speak by themselves: a thread that sends what they say, and the line's faults."""

from __future__ import annotations

import math
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from compd.clock import Clock, MonotonicClock
from compd.twins.device import SimulatedPushedDevice
from compd.twins.line_fault import SILENT, UNPLUGGED, checked_fault
from compd.twins.wire_ends import Port

# The source's clock stands still, or is wrong by an hour.
CLOCK_STUCK, CLOCK_BEHIND, CLOCK_AHEAD = "clock stuck", "clock behind", "clock ahead"
CLOCK_ERROR_S: Mapping[str, float] = {CLOCK_BEHIND: -3600.0, CLOCK_AHEAD: 3600.0}
# Values are kept by a gateway that has lost its network; they come all at once when the fault ends.
HELD_UP = "held up"
# The number comes in another form than it is described: text, or an array.
WRONG_TYPE = "wrong type"
# How often a device speaks that does not say it itself, s.
PERIOD_S = 0.05


class SimulatedPushedLine(ABC):
    """One configured line with its devices, served by a thread of its own.

    fault : of the line, or None. It is followed before the next value is sent.
    kind : of the line. own_faults : those of this kind alone, which `send` shows.
    """

    kind: ClassVar[str]
    own_faults: ClassVar[tuple[str, ...]]

    def __init__(self, name: str, devices: Sequence[SimulatedPushedDevice], clock: Clock | None = None) -> None:
        self._devices = devices
        self._clock = clock or MonotonicClock()
        self._period_s = min((device.period_s or PERIOD_S for device in devices), default=PERIOD_S)
        self._fault: str | None = None
        self._stuck_utc_s: float | None = None  # what a clock that stands still shows, s since 1970
        self._held_up: list[tuple[Mapping[str, Any], float]] = []
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
    def faults(self) -> tuple[str, ...]:
        """Faults that this kind of line can have."""
        return (SILENT, UNPLUGGED, CLOCK_STUCK, *CLOCK_ERROR_S, HELD_UP, WRONG_TYPE, *self.own_faults)

    @property
    def fault(self) -> str | None:
        """The line's fault, or None."""
        return self._fault

    @fault.setter
    def fault(self, fault: str | None) -> None:
        self._fault = checked_fault(fault, self.faults, self.kind)

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
    def send(self, values: Mapping[str, Any], utc_s: float, fault: str | None = None) -> None:
        """Send values by topic or node, as `SimulatedPushedDevice.say` gives them.

        utc_s : what the source's clock shows, s since 1970. fault : WRONG_TYPE or one of `own_faults`.
        """

    def _run(self) -> None:
        connected = True
        while not self._clock.wait(self._stop, self._period_s):
            fault = self._fault
            if (fault == UNPLUGGED) is connected:
                (self.pull_out if connected else self.plug_in)()
                connected = not connected
            if connected and fault != SILENT:
                self._speak(fault)
        if connected:
            self.pull_out()

    def _speak(self, fault: str | None) -> None:
        utc_s = time.time()
        self._stuck_utc_s = (self._stuck_utc_s or utc_s) if fault == CLOCK_STUCK else None
        shown_s = (self._stuck_utc_s or utc_s) + CLOCK_ERROR_S.get(fault or "", 0.0)
        self._held_up += [(device.say(shown_s), shown_s) for device in self._devices]
        if fault == HELD_UP:
            return
        held_up, self._held_up = self._held_up, []
        for values, measured_s in held_up:
            self.send(values, measured_s, fault)


def is_off(value: Any) -> bool:
    """Whether a sensor, or one of several, is off."""
    return any(math.isnan(number) for number in (value if isinstance(value, list) else [value]))
