"""Taking machine zero: every length gauge read for a while with the machine at rest, then kept on disk."""

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
from compd.live.service.background_job import BackgroundJob
from compd.live.service.messages import ErrorCode, ProtocolError, line
from compd.readings import Latest

# Long enough to average a comparator's noise over several polls, short enough to stand beside.
_WINDOW_S = 1.0
_LOOK_EVERY_S = 0.02
# A machine at rest stays within a few steps of its gauges; one that moves leaves this in milliseconds.
REST_TOLERANCE_MM = 0.005

_log = structlog.get_logger()


class ZeroCapture:
    """Takes one zero at a time, on a thread of its own: neither loop nor publisher waits for gauges or disk."""

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
        self._errand = BackgroundJob("zero", "machine zero is being taken already")

    def take(self, answer: Callable[[bytes], None]) -> None:
        """Start; `answer` gets the ZERO or ERROR line when it is done. Raises ProtocolError while one is running."""
        self._errand.begin(self._taken, answer)

    def stop(self) -> None:
        """Give up what is running; returns when it has ended."""
        self._stop.set()
        self._errand.join()

    def _taken(self) -> bytes:
        """Do it; the ZERO or ERROR line."""
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
        """Mean raw reading (mm) of every length gauge over the window, each reading counted once.

        Raises StateError when a gauge is not good at any moment of it, or the machine is not at rest.
        """
        seen: dict[str, dict[float, float]] = defaultdict(dict)
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
                seen[wire.channel][reading.time_s] = reading.value
            if snapshot.time_s - start_s >= _WINDOW_S:
                break
            if self._clock.wait(self._stop, _LOOK_EVERY_S):
                raise StateError(
                    Problem(where="machine zero", what="the daemon is stopping", next_step="take zero again")
                )
        for channel, readings in seen.items():
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
        return {channel: sum(readings.values()) / len(readings) for channel, readings in seen.items()}
