"""What every gauge showed last, on disk: one that was switched off with the computer may count anew.

When the daemon starts, a gauge must show what it showed last, as after any loss of its line, and at the same port; one
that was not believed is not believed. Where the computer was started anew, the gauges may have been without power.
A temperature goes on from what it was, by no more than it can have changed meanwhile.
"""

from __future__ import annotations

import json
import math
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import structlog
from pydantic import BaseModel, ConfigDict, FiniteFloat, ValidationError

from compd.files import CHECKSUM, checksum_of
from compd.live.memory import Doubt, TrustMemory
from compd.live.system import System, changed_ports

FILE_NAME = "last-readings.json"
_FORMAT = 1
# Drift of a gauge that is not written again, as a share of the tolerance within which it must come back.
_WRITTEN_SHARE = 0.5
# Least interval (s) of writing the file, which happens only after a motion or a distrust of a gauge.
_LOOK_EVERY_S = 1.0
_END_WITHIN_S = 0.5
# Ten times what a machine with a hundred gauges leaves.
_MAX_BYTES = 1_000_000

_NO_PORTS: Mapping[str, str] = {}
log = structlog.get_logger()


class _LastDoubt(BaseModel):
    model_config = ConfigDict(strict=True)

    doubt: int = 0
    amount: float | None = None
    evidence: str = ""
    port: str = ""
    power_lost: bool = False


class _LastReading(_LastDoubt):
    value_mm: FiniteFloat


class _LastQuantity(_LastDoubt):
    """value : in the unit of the quantity's name."""

    value: FiniteFloat


class _LastReadingsFile(BaseModel):
    model_config = ConfigDict(strict=True)

    format: int
    zero_hash: str
    boot_id: str
    time_s: FiniteFloat
    readings: dict[str, _LastReading]
    quantities: dict[str, _LastQuantity] = {}
    checksum: str = ""


class LastReadings:
    """Keeps `TrustMemory` on disk, by a thread of its own."""

    def __init__(
        self, directory: Path, zero_hash: str, memory: TrustMemory, system: System, ports: Mapping[str, str] = _NO_PORTS
    ) -> None:
        """`zero_hash`: of the configuration; readings of another one say nothing. `ports`: the lasting name of each
        gauge's port."""
        self._ports = ports
        self._path = directory / FILE_NAME
        self._zero_hash = zero_hash
        self._memory = memory
        self._system = system
        self._stop = threading.Event()
        self._thread = system.thread(self._run, "last readings")
        self._written: tuple[np.ndarray, np.ndarray] | None = None
        self._failed = False

    def recall(self) -> None:
        """Take what is on disk into the memory; before any gauge is read."""
        file = self._read()
        if file is None or file.zero_hash != self._zero_hash or file.format != _FORMAT:
            return
        self._take(file)

    def _take(self, file: _LastReadingsFile) -> None:
        memory, now_s = self._memory, self._system.monotonic()
        values = {channel: last.value_mm for channel, last in file.readings.items()}
        values |= {channel: last.value for channel, last in file.quantities.items()}
        doubts: dict[str, _LastDoubt] = {**file.readings, **file.quantities}
        known = {memory.index[channel]: last for channel, last in doubts.items() if channel in memory.index}
        for i in known:
            memory.believe(i, values[memory.channels[i]], now_s)
        memory.witness[:] = memory.value[: memory.lengths]
        for i, last in known.items():
            if last.doubt > Doubt.LOST:
                memory.distrust(i, Doubt(min(last.doubt, max(Doubt))), math.nan if last.amount is None else last.amount)
            elif i >= memory.lengths and file.boot_id == self._system.boot_id():
                memory.believe(
                    i, values[memory.channels[i]], file.time_s
                )  # since then it changes no faster than it can
            else:
                memory.lose(i, now_s, power=last.power_lost or file.boot_id != self._system.boot_id())
        memory.tell({memory.channels[i]: last.evidence for i, last in known.items() if last.evidence})
        before = {memory.channels[i].partition(".")[0]: last.port for i, last in known.items() if last.port}
        memory.distrust_ports(changed_ports(before, self._ports))

    def _read(self) -> _LastReadingsFile | None:
        """What is on disk; None where there is nothing, or nothing that can be used."""
        try:
            content = self._system.read_file(self._path, _MAX_BYTES).decode()
        except FileNotFoundError:
            return None
        except (OSError, UnicodeDecodeError) as error:
            log.warning("last readings cannot be read", path=str(self._path), reason=str(error))
            return None
        try:
            data = json.loads(content)
            file = _LastReadingsFile.model_validate(data)
            if file.checksum and file.checksum != checksum_of(data):
                raise ValueError("the checksum does not fit")
        except (ValueError, RecursionError, ValidationError) as error:
            log.warning("last readings are damaged", path=str(self._path), reason=str(error).splitlines()[0])
            return None
        if not file.checksum:
            log.warning("last readings have no checksum: what was changed in them cannot be seen", path=str(self._path))
        return file

    def start(self) -> None:
        """Write from now on."""
        self._thread.start()

    def stop(self) -> None:
        """Write once more, and end the thread; a disk that hangs is not waited for."""
        self._stop.set()
        self._thread.join(_END_WITHIN_S)

    def _run(self) -> None:
        while not self._system.wait(self._stop, _LOOK_EVERY_S):
            self._write_if_changed()
        self._written = None  # at the end in any case: its time says for how long the daemon was away
        self._write_if_changed()

    def _write_if_changed(self) -> None:
        memory, n = self._memory, len(self._memory.channels)
        value, doubt = memory.value[:n].copy(), memory.doubt[:n].copy()
        known = ~np.isnan(value)
        if not known.any():
            return
        if self._written is not None:
            moved = np.abs(value - self._written[0]) > _WRITTEN_SHARE * memory.tolerance_mm
            new = known & np.isnan(self._written[0])
            if not (moved.any() or new.any() or (doubt != self._written[1]).any()):
                return
        evidence = memory.evidence.read() or {}
        entries = {
            channel: self._entry(i, float(value[i]), int(doubt[i]), evidence.get(channel, ""))
            for i, channel in enumerate(memory.channels)
            if known[i]
        }
        lengths = set(memory.channels[: memory.lengths])
        content: dict[str, Any] = {
            "format": _FORMAT,
            "zero_hash": self._zero_hash,
            "boot_id": self._system.boot_id(),
            "time_s": self._system.monotonic(),
            "readings": {channel: entry for channel, entry in entries.items() if channel in lengths},
            "quantities": {channel: entry for channel, entry in entries.items() if channel not in lengths},
        }
        content[CHECKSUM] = checksum_of(content)
        try:
            self._system.write_files({self._path: json.dumps(content, indent=1, allow_nan=False) + "\n"})
        except OSError as error:
            if not self._failed:
                log.warning("last readings cannot be written", path=str(self._path), reason=error.strerror)
            self._failed = True
            return
        self._failed = False
        self._written = value, doubt

    def _entry(self, i: int, value: float, doubt: int, evidence: str) -> dict[str, Any]:
        entry: dict[str, Any] = {"value_mm" if i < self._memory.lengths else "value": value}
        if port := self._ports.get(self._memory.channels[i].partition(".")[0]):
            entry["port"] = port
        if self._memory.power_lost[i]:
            entry["power_lost"] = True
        if doubt > Doubt.LOST:
            amount = float(self._memory.amount[i])
            entry |= {"doubt": doubt, **({"amount": amount} if math.isfinite(amount) else {})}
            if doubt in (Doubt.VOTED, Doubt.REPLUGGED):
                entry["evidence"] = evidence
        return entry
