"""What the tests of lines and drivers share: clocks, a scripted port, simulated lines, waiting for readings."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from compd.clock import MonotonicClock
from compd.gauge import Gauge, LineFault, Quality, Reading
from compd.line_settings import LineSettings
from compd.lines import open_line
from compd.lines.open import ANY_LINE
from compd.live.memory import Latest
from compd.live.system import System
from compd.plugins import GAUGES, SIMULATED_GAUGES, load
from compd.simulation.wires.simulated_line import SimulatedLine
from tests.support.patience import PATIENCE_S

Sense = Callable[[str], float]
SETTINGS: TypeAdapter[LineSettings] = TypeAdapter(ANY_LINE)


class InstantClock(System):
    """Time passes only by waiting, and waiting takes no time. Notes how long each wait was to be."""

    def __init__(self) -> None:
        self.now_s = 100.0
        self.waits_s: list[float] = []
        self.on_wait: Callable[[], None] = lambda: None

    def monotonic(self) -> float:
        return self.now_s

    def wait(self, event: threading.Event, timeout_s: float) -> bool:
        self.waits_s.append(timeout_s)
        self.now_s += timeout_s
        self.on_wait()
        return event.is_set()


class ScriptedPort:
    """A port on an InstantClock. `script`: what reads find, one after the other; b"" is a silence.

    With `device`, what is written is answered by it; the answer is there at once.
    """

    character_s = 0.0

    def __init__(
        self, clock: InstantClock, script: Sequence[bytes] = (), device: Callable[[bytes], bytes] | None = None
    ) -> None:
        self._clock = clock
        self.script = list(script)
        self._device = device
        self.written: list[bytes] = []
        self.closed = False
        self.control: list[str] = []  # what was done to DTR and break

    def read(self, timeout_s: float) -> bytes:
        data = self.script.pop(0) if self.script else b""
        if not data:
            self._clock.now_s += max(0.0, timeout_s)
        return data

    def write(self, data: bytes) -> None:
        self.written.append(data)
        if self._device is not None:
            self.script += [piece for piece in (self._device(data),) if piece]

    def set_dtr(self, high: bool) -> None:
        self.control.append(f"dtr {'high' if high else 'low'}")

    def set_break(self, on: bool) -> None:
        self.control.append(f"break {'on' if on else 'off'}")

    def close(self) -> None:
        self.closed = True


class WatchedLatest(Latest):
    """Latest that a test can wait on."""

    def __init__(self, channels: Sequence[str]) -> None:
        super().__init__(channels)
        self.history: list[tuple[str, Reading]] = []
        self._changed = threading.Condition()

    def put(self, index: int, reading: Reading) -> None:
        with self._changed:
            super().put(index, reading)
            self.history.append((self.channels[index], reading))
            self._changed.notify_all()

    def put_all(self, readings: Mapping[int, Reading]) -> None:
        with self._changed:
            super().put_all(readings)
            self.history += [(self.channels[index], reading) for index, reading in readings.items()]
            self._changed.notify_all()

    def wait_for(self, channel: str, quality: Quality, after: int = 0) -> Reading:
        """The first reading of `channel` with `quality` since history entry `after`."""
        return self._wait(channel, lambda reading: reading.quality is quality, after, str(quality))

    def wait_for_value(self, channel: str, value: float, after: int = 0) -> Reading:
        """The first good reading of `channel` with this value since history entry `after`."""
        return self._wait(channel, lambda reading: reading.ok and reading.value == value, after, str(value))

    def wait_for_any(self, channel: str, after: int = 0) -> Reading:
        """The first reading of `channel` since history entry `after`."""
        return self._wait(channel, lambda _: True, after, "heard")

    def _wait(self, channel: str, is_wanted: Callable[[Reading], bool], after: int, what: str) -> Reading:
        readings: list[Reading] = []

        def there() -> bool:
            readings.extend(r for name, r in self.history[after:] if name == channel and is_wanted(r))
            return bool(readings)

        with self._changed:
            arrived = self._changed.wait_for(there, PATIENCE_S)
        assert arrived, f"{channel} never became {what}: {self.snapshot(0.0).readings[self.index[channel]]}"
        return readings[0]

    @property
    def now(self) -> int:
        """The history's length: what comes after it is new."""
        return len(self.history)


@dataclass
class Rig:
    """A simulated line, and the settings and drivers with which the daemon's side finds it."""

    wire: SimulatedLine
    settings: LineSettings
    gauges: dict[str, Gauge[Any]]
    values: dict[str, float]

    @contextmanager
    def open(self, timeout_s: float = PATIENCE_S) -> Iterator[Any]:
        """The daemon's side of the line; a reply is waited for as long as the computer takes.

        timeout_s : that of `settings`, or another, where no reply comes.
        """
        line = open_line(self.settings.model_copy(update={"timeout_s": timeout_s}), MonotonicClock())
        try:
            yield line
        finally:
            line.close()


@contextmanager
def rig(
    directory: Path, line: Mapping[str, Any], gauges: Mapping[str, Mapping[str, Any]], values: dict[str, float]
) -> Iterator[Rig]:
    """A simulated line with `gauges` (name -> the driver's options). Its sensors see `values` by channel name."""
    settings = SETTINGS.validate_python(line)
    drivers = {}
    devices = []
    for name, raw in gauges.items():
        driver = load(GAUGES, raw["driver"], name)
        options = driver.Options.model_validate({"line": "line", **raw})
        drivers[name] = driver(options)
        devices.append(load(SIMULATED_GAUGES, raw["driver"], name)(options, lambda channel: values[channel]))
    wire = SimulatedLine("line", settings, devices, directory)
    port = wire.start()
    where = {"port": port} if isinstance(port, str) else {"host": port[0], "port": port[1]}
    try:
        yield Rig(wire, settings.model_copy(update=where), drivers, values)
    finally:
        wire.stop()


Outcome = list[tuple[Quality, Any]]


def polled_until(gauge: Gauge[Any], line: Any, wanted: Callable[[Outcome], bool]) -> None:
    """Poll until the outcome is `wanted`. A computer may be too busy for a reply's timeout: then there is no value."""
    end_s = time.monotonic() + PATIENCE_S
    while not wanted(found := outcome(gauge, line)):
        assert all(quality is not Quality.OK for quality, _ in found), f"a wrong value: {found}"
        assert time.monotonic() < end_s, f"still {found}"


def outcome(gauge: Gauge[Any], line: Any) -> Outcome:
    """One poll: quality and value per channel; a fault of the whole poll counts for each. Drains as the daemon does."""
    try:
        return [(reading.quality, reading.value) for reading in gauge.read(line)]
    except LineFault as fault:
        if fault.quality is not Quality.LINE_LOST:
            line.drain()
        return [(fault.quality, float("nan"))] * len(gauge.channels)
