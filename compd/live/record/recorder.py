"""Recording from the running daemon: raw readings on disk, by a process of its own.

A recorder is a client that watches the daemon's readings. So nothing that it does (disks that stall, files that
fill up, a crash) can reach the loop, the daemon has no files to look after, and a burst is a second recorder beside
the first. The daemon gives it a bounded queue as it does every client: one that falls behind is dropped.

A recording is written in parts, NAME-0001, NAME-0002 ..., each complete in itself:

    NAME-0001.csv           a row per instant, as the recording format says: readings less machine zero
    NAME-0001.yaml          its sidecar; `provenance` holds machine zero and signs: raw = zero + sign * column
    NAME-0001.cycles.jsonl  what the daemon said, line for line and bit for bit: what `compd replay` needs, with
    NAME-0001.model-*.yaml  copies of the model files that were applied or ran as a shadow

A machine zero that is taken anew begins a new part, since the columns of a part have one zero. Whole lines are
written and synchronised twice a second: what a power cut or SIGKILL costs is less than a second.
"""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

from compd.clock import Clock
from compd.errors import CompdError, Problem, RecordingError, StateError
from compd.live.record.recording_part import Message, RecordingPart

_WRITE_EVERY_S = 0.5
# 100 s of a 200 Hz burst, about 80 MB: a disk that stalls for longer is a fault.
_MAX_WAITING = 20_000


@dataclass(frozen=True)
class Keeping:
    """How much is kept, and in what pieces.

    part_bytes, part_s : a part that has reached either is closed, and the next one begun.
    limit_bytes : what all parts of the recording may take.
    drop_oldest : at the limit, delete the oldest part; otherwise recording ends.
    """

    part_bytes: int
    part_s: float
    limit_bytes: int
    drop_oldest: bool

    def __post_init__(self) -> None:
        if self.drop_oldest and self.part_bytes > self.limit_bytes // 2:
            raise RecordingError(
                Problem(
                    where="the size of a part",
                    what="leaves nothing when the oldest is dropped",
                    value=f"{self.part_bytes} bytes",
                    allowed=f"half of the limit at most, {self.limit_bytes // 2} bytes",
                    next_step="make the parts smaller, or the limit larger",
                )
            )


class Recorder:
    """Takes lines from the thread that reads the socket; a thread of its own writes them."""

    def __init__(
        self, name: Path, version: Message, watch: Message, keeping: Keeping, say: Callable[[str], None], clock: Clock
    ) -> None:
        """`name`: the parts' path without "-0001.csv"; `version`, `watch`: the daemon's first two messages; `say`
        is told what a person should know. Raises RecordingError where a recording of this name is there already.
        """
        if there := sorted(name.parent.glob(f"{name.name}-[0-9][0-9][0-9][0-9]*.*")):
            raise RecordingError(
                Problem(where=str(there[0]), what="is there already", next_step="choose another name, or move it away")
            )
        self.rows = 0
        self.dropped = 0
        self.missing = 0
        self._name = name
        self._opening = (version, watch)
        self._every_cycle = "rate_hz" not in watch
        self._keeping = keeping
        self._say = say
        self._clock = clock
        self._waiting: deque[tuple[bytes, Message]] = deque()
        self._parts: list[RecordingPart] = []
        self._numbers = 0
        self._origin_s = math.nan
        self._failure: CompdError | None = None
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)

    def start(self) -> None:
        """Begin to write."""
        self._thread.start()

    def follow(self, lines: Iterable[tuple[bytes, Message]], for_s: float | None) -> None:
        """READINGS as they come, until `for_s` seconds of the daemon's time have passed; None = for ever.

        Raises what `put` raises, and DaemonError when the daemon goes away.
        """
        start_s, before = math.nan, None
        for line, message in lines:
            if before is None:
                start_s = message["time_s"]
            elif for_s is not None and message["time_s"] - start_s >= for_s:
                return
            elif self._every_cycle:
                self.missing += message["seq"] - before - 1
            before = message["seq"]
            self.put(line, message)

    def put(self, line: bytes, message: Message) -> None:
        """One READINGS line. Raises what ended the writing: the limit, the disk, or a daemon without machine zero."""
        if self._failure is not None:
            raise self._failure
        if len(self._waiting) >= _MAX_WAITING:
            self.dropped += 1
            return
        self._waiting.append((line, message))

    def close(self) -> None:
        """Write what waits and close the files. Raises what ended the writing."""
        self._stop.set()
        self._thread.join()
        if self._failure is not None:
            raise self._failure

    def summary(self) -> str:
        """What became of it, for a person."""
        parts = f"{self.rows} rows in {self._numbers} part{'s' * (self._numbers != 1)}"
        lost = [
            f"{count} {what}"
            for count, what in ((self.missing, "cycles did not come"), (self.dropped, "rows dropped: the disk stalled"))
            if count
        ]
        return ", ".join([parts, *lost])

    def _run(self) -> None:
        try:
            self._write_until_stopped()
        except CompdError as failure:
            self._failure = failure
        except OSError as error:
            self._failure = RecordingError(
                Problem(
                    where=str(self._name.parent),
                    what=f"cannot be written to: {error.strerror}",
                    next_step="what was written before is whole; make room, and record under another name",
                )
            )

    def _write_until_stopped(self) -> None:
        try:
            while not self._clock.wait(self._stop, _WRITE_EVERY_S):
                self.write()
            self.write()
        finally:
            if self._parts:
                self._parts[-1].close()

    def write(self) -> None:
        """Everything that waits, to the disk; the writing thread's."""
        while self._waiting:
            line, message = self._waiting.popleft()
            part = self._part_for(message)
            part.add(line, message)
            for hash_, file in message.get("model_files", {}).items():
                if fault := part.keep_model(hash_, Path(file)):
                    self._say(f"the model file {file} {fault}: it is not kept, and replay will ask for it")
            self.rows += 1
            if self._bytes() > self._keeping.limit_bytes:
                self._at_limit()
        if self._parts:
            self._parts[-1].sync()

    def _part_for(self, message: Message) -> RecordingPart:
        """The part that the message belongs to, new where the last one is full or has another zero."""
        if "zero" not in message:
            raise StateError(
                Problem(
                    where="the daemon",
                    what="has no machine zero, from which a recording's columns count",
                    next_step="take it with `compd zero`, then record",
                )
            )
        if not self._parts:
            self._origin_s = message["time_s"]
            return self._begin(message)
        last, keeping = self._parts[-1], self._keeping
        if message["zero"] != last.zero:
            self._say("machine zero was taken anew")
        elif last.size < keeping.part_bytes and message["time_s"] - last.start_s < keeping.part_s:
            return last
        last.close()
        return self._begin(message)

    def _begin(self, message: Message) -> RecordingPart:
        self._numbers += 1
        stem = self._name.with_name(f"{self._name.name}-{self._numbers:04d}")
        ago = timedelta(seconds=self._clock.monotonic() - message["time_s"])
        started_at = (datetime.now(UTC) - ago).isoformat(timespec="milliseconds")
        part = RecordingPart(stem, self._opening, message, self._origin_s, started_at)
        self._parts.append(part)
        self._say(f"{part.csv_path} begins")
        return part

    def _bytes(self) -> int:
        return sum(part.size for part in self._parts)

    def _at_limit(self) -> None:
        limit = f"{self._keeping.limit_bytes / 1e6:g} MB"
        if not self._keeping.drop_oldest:
            raise RecordingError(
                Problem(
                    where=str(self._name),
                    what="the recording has reached its limit on disk and ends here",
                    value=limit,
                    next_step="give a larger limit, or let the oldest part be dropped",
                )
            )
        while self._bytes() > self._keeping.limit_bytes and len(self._parts) > 1:
            oldest = self._parts.pop(0)
            oldest.delete()
            self._say(f"limit of {limit}: {oldest.csv_path} deleted, with {oldest.rows} rows")
