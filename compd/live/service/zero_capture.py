"""Taking machine zero: average every length gauge for a second with the machine at rest, and keep the means on disk."""

from __future__ import annotations

import threading
from collections import defaultdict
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import structlog

from compd.clock import Clock
from compd.errors import Problem, StateError
from compd.live.loop.commands import Commands
from compd.live.loop.machine_zero import MachineZero
from compd.live.loop.wiring import MachineWires
from compd.live.memory.latest import Latest
from compd.live.service.background_job import BackgroundJob
from compd.live.service.messages import ErrorCode, ProtocolError, line

# Several polls of a comparator, to average its noise, and short enough for a person to wait.
_WINDOW_S = 1.0
_LOOK_EVERY_S = 0.02
# A machine at rest stays within a few steps of its gauges; one that moves leaves this in milliseconds.
REST_TOLERANCE_MM = 0.005

_log = structlog.get_logger()


class ZeroCapture:
    """Takes machine zero on a thread of its own, so that neither loop nor publisher waits for gauges or disk.

    It is the only writer of `Commands.zero` while the daemon runs. One zero at a time.
    """

    def __init__(
        self, wires: MachineWires, latest: Latest, commands: Commands, directory: Path, zero_hash: str, clock: Clock
    ) -> None:
        self._wires = wires
        self._latest = latest
        self._commands = commands
        self._directory = directory
        self._zero_hash = zero_hash
        self._clock = clock
        self._stop = threading.Event()
        self._job = BackgroundJob("zero", "machine zero is being taken already")

    def start(self, answer: Callable[[bytes], None]) -> None:
        """Begin; `answer` gets the ZERO or ERROR line at the end. Raises ProtocolError while one is being taken."""
        self._job.start(self._capture, answer)

    def stop(self) -> None:
        """Give up a zero that is being taken; return when its thread has ended."""
        self._stop.set()
        self._job.join()

    def _capture(self) -> bytes:
        try:
            zero = MachineZero(self._zero_hash, datetime.now(UTC).isoformat(timespec="seconds"), self.sample())
            path = zero.save(self._directory)
        except StateError as error:
            _log.warning("machine zero refused", reason=str(error))
            return ProtocolError(ErrorCode.ZERO_REFUSED, str(error)).to_json()
        self._commands.zero = zero
        _log.info("machine zero taken", path=str(path))
        return line(
            {"class": "ZERO", "taken_at": zero.taken_at, "path": str(path), "readings_mm": dict(zero.readings_mm)}
        )

    def sample(self) -> dict[str, float]:
        """Mean raw reading (mm) of every length gauge, by channel, over `_WINDOW_S`; each reading counts once.

        Raises StateError when a gauge is not good at any moment of the window, or when its readings spread over more
        than REST_TOLERANCE_MM: the machine is not at rest.
        """
        # By channel and time of reading: a snapshot repeats the readings that no newer one has replaced.
        values_mm: dict[str, dict[float, float]] = defaultdict(dict)
        start_s = self._clock.monotonic()
        while True:
            snapshot = self._latest.snapshot(self._clock.monotonic())
            if lost := self._wires.lost(snapshot):
                raise StateError(
                    Problem(
                        where="machine zero",
                        what=f"not every gauge can be read: {lost}",
                        next_step="mend the gauge, then take zero again",
                    )
                )
            for wire in self._wires.length_wires:
                reading = snapshot.readings[wire.slot]
                values_mm[wire.channel][reading.time_s] = reading.value
            if snapshot.time_s - start_s >= _WINDOW_S:
                break
            if self._clock.wait(self._stop, _LOOK_EVERY_S):
                raise StateError(
                    Problem(where="machine zero", what="the daemon is stopping", next_step="take zero again")
                )
        for channel, readings in values_mm.items():
            spread_mm = max(readings.values()) - min(readings.values())
            if spread_mm > REST_TOLERANCE_MM:
                raise StateError(
                    Problem(
                        where="machine zero",
                        what=f"{channel} moved while zero was taken",
                        value=f"{spread_mm:.4f} mm",
                        allowed=f"{REST_TOLERANCE_MM:g} mm",
                        next_step="let the machine stand still, then take zero again",
                    )
                )
        return {channel: sum(readings.values()) / len(readings) for channel, readings in values_mm.items()}
