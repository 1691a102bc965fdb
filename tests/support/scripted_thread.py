"""A line's thread on scripted gauges in simulated time."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from typing import Any

from compd.gauge import Channel, Gauge, LineFault, Quality, Reading, good
from compd.lines import Ports
from compd.live.acquisition.acquisition import LineThread
from compd.live.memory import PollRequests
from compd.live.service.message_keys.status import LineStatusKeys
from compd.live.system import System
from tests.support.patience import PATIENCE_S
from tests.support.wire_rig import SETTINGS, InstantClock, WatchedLatest

STALE_AFTER_S = 0.5
SETTINGS_TCP = SETTINGS.validate_python({"kind": "tcp", "host": "x", "port": 1, "timeout_s": 0.1})


class CountingLine:
    """A line that only counts what acquisition does with it."""

    last_request_s = -math.inf
    unexpected_bytes = 0
    request_came_back = False

    def __init__(self) -> None:
        self.drained = 0
        self.closed = False

    def drain(self, quiet_s: float | None = None) -> bytes:
        self.drained += 1
        return b""

    def close(self) -> None:
        self.closed = True


class ScriptedGauge(Gauge[Any]):
    """A driver that does what `poll` does."""

    def __init__(self, poll: Callable[[], Sequence[Any]], channels: int = 1) -> None:
        super().__init__(None)
        self._poll = poll
        self._channels = [Channel(f"c{i}") for i in range(channels)]

    @property
    def channels(self) -> Sequence[Channel]:
        return self._channels

    def read(self, line: Any) -> Sequence[Reading]:
        return self._poll()


class ScriptedThread:
    """One LineThread on an InstantClock, run to the end of its script on its own thread."""

    def __init__(self, *drivers: Gauge[Any], opener: Any = None, settings: Any = SETTINGS_TCP) -> None:
        self.clock = InstantClock()
        self.lines: list[CountingLine] = []
        names = [(f"g{i}", driver) for i, driver in enumerate(drivers)]
        self.latest = WatchedLatest([f"{name}.{c.name}" for name, driver in names for c in driver.channels])
        stale_after_s = {name: STALE_AFTER_S for name, _ in names}
        self.poll_requests = PollRequests([name for name, _ in names])
        self.thread = LineThread(
            "line",
            settings,
            names,
            stale_after_s,
            self.latest,
            self.clock,
            opener or self.open,
            poll_requests=self.poll_requests,
        )

    def open(self, settings: Any, system: System, ports: Ports) -> CountingLine:
        self.lines.append(CountingLine())
        return self.lines[-1]

    def run(self) -> None:
        self.thread.start()
        assert self.thread.join(PATIENCE_S)
        assert self.thread.status()["state"] == "stopped"
        assert all(line.closed for line in self.lines)
        LineStatusKeys.model_validate_json(json.dumps(self.thread.status(), allow_nan=False))

    def qualities(self, channel: str) -> list[Quality]:
        return [reading.quality for name, reading in self.latest.history if name == channel]


def polls_with_faults(*faults: LineFault | None, period_s: float = 0.1) -> ScriptedThread:
    """A gauge polled once per fault, `period_s` apart: with None it is well and shows the number of the poll."""
    left = list(enumerate(faults, start=1))

    def poll() -> list[Reading]:
        number, fault = left.pop(0)
        scripted.clock.now_s += period_s
        if not left:
            scripted.thread.stop()
        if fault is not None:
            raise fault
        return [good(float(number), scripted.clock.now_s)]

    scripted = ScriptedThread(ScriptedGauge(poll))
    scripted.run()
    return scripted
