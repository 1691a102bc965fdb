"""Taking machine zero: average every gauge for a second with the machine at rest, and keep the means on disk."""

from __future__ import annotations

import math
import threading
from collections import defaultdict
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

import numpy as np
import structlog

from compd.errors import StateError
from compd.gauge import Quality
from compd.live.loop import Commands
from compd.live.machine import MachineWires, MachineZero, withdraw_zero
from compd.live.memory import Latest
from compd.live.service.message_keys.answers import ZeroKeys
from compd.live.service.messages import ErrorCode, ProtocolError
from compd.live.system import System


class BackgroundJob:
    """Runs one piece of work at a time. It is free again before the answer goes out, so that the client that has the
    answer may ask at once for the next one."""

    def __init__(self, name: str, busy_text: str, system: System) -> None:
        """`name`: the thread's; `busy_text`: the error's text for a client that asks while work is running."""
        self._name = name
        self._system = system
        self._busy_text = busy_text
        self._running = False
        self._thread: threading.Thread | None = None

    def start(self, work: Callable[[], bytes], answer: Callable[[bytes], None]) -> None:
        """Start `work`; `answer` gets the line that it returns. Raises ProtocolError while other work is running."""
        if self._running:
            raise ProtocolError(ErrorCode.BUSY, self._busy_text)
        self._running = True
        self._thread = self._system.thread(partial(self._run, work, answer), self._name)
        self._thread.start()

    def join(self, timeout_s: float | None = None) -> bool:
        """Return when nothing is running, or after `timeout_s`: whether nothing is. What still runs holds up no end."""
        if self._thread is None:
            return True
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _run(self, work: Callable[[], bytes], answer: Callable[[bytes], None]) -> None:
        try:
            reply = work()
        finally:
            self._running = False
        answer(reply)


# Several polls of a comparator, to average its noise, and short enough for a person to wait.
_WINDOW_S = 1.0
_LOOK_EVERY_S = 0.02
# A machine at rest stays within a few steps of its gauges; one that moves leaves this in milliseconds.
REST_TOLERANCE_MM = 0.005
# A machine that comes to its zero position again is nearer than this to where it was.
MAX_CHANGE_MM = 0.5
# A gauge that has been accepted is believed from its next answers on.
_BELIEVED_WITHIN_S = 3.0
# The disk may hang; the daemon's end waits no longer for it.
_END_WITHIN_S = 0.5
# Differences that an error names: the largest.
_NAMED = 6

_NO_PORTS: Mapping[str, str] = {}
_log = structlog.get_logger()


class ZeroCapture:
    """Takes machine zero on a thread of its own, so that neither loop nor publisher waits for gauges or disk.

    It is the only writer of `Commands.zero` while the daemon runs. One zero at a time.
    """

    def __init__(
        self,
        wires: MachineWires,
        latest: Latest,
        commands: Commands,
        directory: Path,
        zero_hash: str,
        system: System,
        accept: Callable[[str], object] = lambda gauge: None,
        ports: Mapping[str, str] = _NO_PORTS,
    ) -> None:
        """`accept`: as in `Requests`; who takes zero has looked at the machine, and accepts every length. `ports`: the
        lasting name of each gauge's port."""
        self._ports = ports
        self._accept = accept
        self._wires = wires
        self._latest = latest
        self._commands = commands
        self._directory = directory
        self._zero_hash = zero_hash
        self._system = system
        self._stop = threading.Event()
        self._job = BackgroundJob("zero", "machine zero is being taken already", system)

    def start(self, replace: bool, answer: Callable[[bytes], None]) -> None:
        """Begin; `answer` gets the ZERO or ERROR line at the end. Raises ProtocolError while one is being taken.

        replace : take it also where a gauge differs from the zero until now by more than MAX_CHANGE_MM, or is not
        believed.
        """
        self._job.start(lambda: self._capture(replace), answer)

    def stop(self) -> None:
        """Give up a zero that is being taken; return when its thread has ended, or the disk has not let it for long."""
        self._stop.set()
        if not self._job.join(_END_WITHIN_S):
            _log.warning("machine zero is still being taken, and is given up")

    def _capture(self, replace: bool) -> bytes:
        try:
            zero, changed_mm = self._measure(replace)
            path = zero.save(self._directory, self._system)
        except ProtocolError as error:
            _log.warning("machine zero differs", reason=error.text)
            return error.to_json()
        except StateError as error:
            _log.warning("machine zero refused", reason=str(error))
            return ProtocolError(ErrorCode.ZERO_REFUSED, str(error)).to_json()
        except Exception as error:  # noqa: BLE001  the client gets an answer whatever happens
            reason = f"{type(error).__name__}: {error}"
            _log.warning("machine zero refused", reason=reason, exc_info=True)
            return ProtocolError(ErrorCode.ZERO_REFUSED, reason).to_json()
        self._commands.zero = zero
        self._accept_lengths()
        without = [name for name in self._wires.quantity_names if name not in zero.quantities]
        if without:
            _log.warning("machine zero is without quantities that could not be read", quantities=", ".join(without))
        _log.info("machine zero taken", path=str(path), changed_mm=_named(changed_mm) if changed_mm else "")
        return ZeroKeys.line(
            taken_at=zero.taken_at,
            path=str(path),
            readings_mm=zero.readings_mm,
            quantities=zero.quantities or None,
            without=without or None,
            changed_mm={channel: round(change_mm, 7) for channel, change_mm in changed_mm.items()} or None,
        )

    def _measure(self, replace: bool) -> tuple[MachineZero, dict[str, float]]:
        """A new machine zero, and by how much it differs from the one until now, by channel, mm.

        Raises StateError where it cannot be taken, ProtocolError (zero_differs) where it needs `replace`.
        """
        before = self._commands.zero
        if distrusted := self._distrusted():
            if not replace:
                raise ProtocolError(
                    ErrorCode.ZERO_DIFFERS,
                    f"not believed: {'; '.join(distrusted)}. Machine zero takes every gauge as it reads now",
                )
            # They are believed again before it is known whether zero can be taken: with the one until now their
            # readings would be wrong by whatever they have lost, also in a daemon that starts meanwhile.
            withdraw_zero(self._directory, self._system)
            self._commands.zero = StateError.of(
                "machine zero",
                "gauges were accepted in order to take it",
                value=", ".join(text.partition(" ")[0] for text in distrusted),
                next_step="where it was refused, take it again: `compd zero`",
            )
            self._accept_lengths()
            self._wait_until_believed()
        taken_at = self._system.utc().isoformat(timespec="seconds")
        zero = MachineZero(self._zero_hash, taken_at, *self.sample(), self._ports)
        if not isinstance(before, MachineZero):
            return zero, {}
        changed_mm = zero.changes_mm(before)
        if not replace and any(abs(change_mm) > MAX_CHANGE_MM for change_mm in changed_mm.values()):
            raise ProtocolError(
                ErrorCode.ZERO_DIFFERS,
                f"more than {MAX_CHANGE_MM:g} mm from the machine zero of {before.taken_at}: {_named(changed_mm)}",
            )
        return zero, changed_mm

    def _accept_lengths(self) -> None:
        """What a quantity is does not count from zero: one that is not believed stays so, and zero is without it."""
        for wire in self._wires.length_wires:
            self._accept(wire.channel)

    def _distrusted(self) -> list[str]:
        """Each length gauge that is not believed, with the reason."""
        readings = self._latest.snapshot(self._system.monotonic()).readings
        of_wires = [(wire.channel, readings[wire.slot]) for wire in self._wires.length_wires]
        return [
            f"{channel} ({reading.detail or 'no reason given'})"
            for channel, reading in of_wires
            if reading.quality is Quality.DISTRUSTED
        ]

    def _wait_until_believed(self) -> None:
        """Until no length gauge is distrusted, or too long; what is not believed then is refused as not read."""
        end_s = self._system.monotonic() + _BELIEVED_WITHIN_S
        while self._distrusted() and self._system.monotonic() < end_s:
            if self._system.wait(self._stop, _LOOK_EVERY_S):
                return

    def sample(self) -> tuple[dict[str, float], dict[str, float]]:
        """Mean raw reading (mm) of every length gauge, by channel, over `_WINDOW_S`; and of every other quantity, by
        name, of which each reading in that time was good. Each reading counts once.

        Raises StateError when a gauge is not good at any moment of the window, or when its readings spread over more
        than REST_TOLERANCE_MM: the machine is not at rest.
        """
        # By channel and time of reading: a snapshot repeats the readings that no newer one has replaced.
        values_mm: dict[str, dict[float, float]] = defaultdict(dict)
        quantities: dict[str, dict[float, float]] = defaultdict(dict)
        names = self._wires.quantity_names
        wires, not_good = self._wires.quantity_wires(names), set[str]()
        start_s = self._system.monotonic()
        while True:
            snapshot = self._latest.snapshot(self._system.monotonic())
            if lost := self._wires.lost(snapshot):
                raise StateError.of(
                    "machine zero",
                    f"not every gauge can be read: {lost}",
                    next_step="mend the gauge, then take zero again",
                )
            for wire in self._wires.length_wires:
                reading = snapshot.readings[wire.slot]
                values_mm[wire.channel][reading.time_s] = reading.value
            for name, wire, value in zip(
                names, wires.wires, wires.read(snapshot, np.zeros(len(names))).values, strict=True
            ):
                quantities[name][snapshot.readings[wire.slot].time_s] = value
                if math.isnan(value):
                    not_good.add(name)
            if snapshot.time_s - start_s >= _WINDOW_S:
                break
            if self._system.wait(self._stop, _LOOK_EVERY_S):
                raise StateError.of("machine zero", "the daemon is stopping", next_step="take zero again")
        for channel, readings in values_mm.items():
            spread_mm = max(readings.values()) - min(readings.values())
            if spread_mm > REST_TOLERANCE_MM:
                raise StateError.of(
                    "machine zero",
                    f"{channel} moved while zero was taken",
                    value=f"{spread_mm:.4f} mm",
                    allowed=f"{REST_TOLERANCE_MM:g} mm",
                    next_step="let the machine stand still, then take zero again",
                )
        return _means(values_mm), {name: mean for name, mean in _means(quantities).items() if name not in not_good}


def _means(readings: Mapping[str, Mapping[float, float]]) -> dict[str, float]:
    """Mean of each gauge's readings, by time."""
    return {name: float(sum(values.values()) / len(values)) for name, values in readings.items()}


def _named(changes_mm: Mapping[str, float]) -> str:
    """The largest changes, by channel, in words."""
    largest = sorted(changes_mm, key=lambda channel: -abs(changes_mm[channel]))
    named = ", ".join(f"{channel} {changes_mm[channel]:+.4f} mm" for channel in largest[:_NAMED])
    return named + (f" and {len(largest) - _NAMED} more" if len(largest) > _NAMED else "")
