"""The recorder: raw readings of a running daemon, written to disk by a process of its own.

A recorder is a client that watches the daemon's READINGS. Stalling disks, full disks and crashes of the recorder
therefore cannot reach the loop, and a second recorder may run beside the first. As for every client, the daemon keeps
a bounded queue for it and drops it when it falls behind.

A recording is written in parts, NAME-0001, NAME-0002 ..., each complete in itself:

    NAME-0001.csv           one row per cycle in the recording format: readings less machine zero; or NAME-0001.parquet,
                            which is NAME-0001.arrow until the part is closed
    NAME-0001.yaml          its sidecar; `provenance` holds machine zero and signs: raw = zero + sign * column
    NAME-0001.cycles.jsonl  the daemon's messages as they came, byte for byte, for `compd recording replay`; among them
                            an ORDER for each order that a client gave, with who gave it
    NAME-0001.model-*.yaml  copies of the model files that were applied or ran as the shadow

A new part begins when machine zero is taken anew, since the columns of a part have one zero, and when the daemon has
started anew (`ReadingsFeed`). Whole lines are written and synchronised twice a second, so a power cut or SIGKILL costs
less than a second. Every row has its cycle, also where the disk was full. Of Parquet the next recorder of the name, or
`compd recording convert`, closes the part that a kill has left open.
"""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path

from compd.configuration import Configuration
from compd.errors import CompdError, RecordingError, StateError
from compd.live.record.part_table import close_left_parts
from compd.live.record.readings_feed import FeedItem
from compd.live.record.recording_part import ORDER, RecordingPart
from compd.live.record.table_rows import Message
from compd.live.system import System
from compd.table_file import PARQUET
from compd.tables import TableFormat, arrow_modules

_WRITE_EVERY_S = 0.5
# 100 s of a 200 Hz burst, about 80 MB: a disk that stalls for longer is a fault.
_MAX_WAITING = 20_000


@dataclass(frozen=True)
class RecordingLimits:
    """Sizes of a recording and of its parts.

    part_bytes, part_s : a part that has reached either is closed, and the next one begins.
    limit_bytes : what all parts together may take.
    drop_oldest : at `limit_bytes` the oldest part is deleted; otherwise recording ends there.
    """

    part_bytes: int
    part_s: float
    limit_bytes: int
    drop_oldest: bool

    def __post_init__(self) -> None:
        if self.drop_oldest and self.part_bytes > self.limit_bytes // 2:
            raise RecordingError.of(
                "the size of a part",
                "leaves nothing when the oldest is dropped",
                value=f"{self.part_bytes} bytes",
                allowed=f"half of the limit at most, {self.limit_bytes // 2} bytes",
                next_step="make the parts smaller, or the limit larger",
            )


class Recorder:
    """Writes a recording. Lines come from the thread that reads the socket; a thread of the recorder writes them."""

    def __init__(
        self,
        name: Path,
        version: Message,
        watch: Message,
        limits: RecordingLimits,
        report: Callable[[str], None],
        system: System,
        table_format: TableFormat = TableFormat.CSV,
        configuration: Configuration | None = None,
    ) -> None:
        """`name`: path of the parts without "-0001.csv"; `version`, `watch`: the daemon's first two messages;
        `report`: called with sentences for the user; `configuration`: the daemon's as far as it is known, which the
        sidecars of its parts name. Raises RecordingError where a recording of this name exists, and
        for Parquet without pyarrow.
        """
        close_left_parts(name, report)
        if table_format is TableFormat.PARQUET:
            arrow_modules(name.with_name(f"{name.name}{PARQUET}"))
        if existing := sorted(name.parent.glob(f"{name.name}-[0-9][0-9][0-9][0-9]*.*")):
            raise RecordingError.of(
                str(existing[0]), "is there already", next_step="choose another name, or move it away"
            )
        self.dropped = 0  #: messages that were not written because the disk stalled
        self.missing = 0  #: cycles whose message never came, where every cycle was asked for
        #: messages of a daemon that has started anew and has no machine zero: from nothing a column can count
        self.without_zero = 0
        self._name = name
        self._first_messages = (version, watch)
        self._table_format = table_format
        self._configuration = configuration
        self._every_cycle = "rate_hz" not in watch
        self._limits = limits
        self._report = report
        self._system = system
        self._waiting: deque[FeedItem] = deque()
        self._received = 0
        self._rows_deleted = 0
        self._parts: list[RecordingPart] = []
        self._part_count = 0
        self._origin_s = math.nan
        self._failure: CompdError | None = None
        self._stop = threading.Event()
        self._thread = system.thread(self._run, "recorder")

    def start(self) -> None:
        """Start the writing thread."""
        self._thread.start()

    @property
    def rows(self) -> int:
        """READINGS messages written, in parts that are there or were deleted at the limit."""
        return self._rows_deleted + sum(part.rows for part in self._parts)

    def follow(self, items: Iterable[FeedItem]) -> None:
        """Record READINGS as they come, of one daemon after the other.

        Raises what `put` raises.
        """
        last_seq = None
        for first_messages, line, message in items:
            if first_messages is not self._first_messages:
                self._first_messages, last_seq = first_messages, None
            if message.get("class") == ORDER:
                if len(self._waiting) >= _MAX_WAITING:
                    continue
                self._waiting.append(FeedItem(first_messages, line, message))
                continue
            if last_seq is not None and self._every_cycle:
                self.missing += message["seq"] - last_seq - 1
            last_seq = message["seq"]
            self.put(line, message)

    def put(self, line: bytes, message: Message) -> None:
        """Queue one READINGS line.

        Raises what ended the writing: the limit, the disk, or a daemon without machine zero.
        """
        if self._failure is not None:
            raise self._failure
        if len(self._waiting) >= _MAX_WAITING:
            self.dropped += 1
            return
        self._received += 1
        self._waiting.append(FeedItem(self._first_messages, line, message))

    def close(self) -> None:
        """Write the queued lines and close the files. Raises what ended the writing."""
        self._stop.set()
        self._thread.join()
        if self._failure is not None:
            raise self._failure

    def summary(self) -> str:
        """Rows and parts written, and what is missing, as a sentence."""
        rows = self.rows
        parts = f"{rows} rows in {self._part_count} part{'s' * (self._part_count != 1)}"
        counts = (
            (self.missing, "cycles did not come"),
            (self.dropped, "rows dropped: the disk stalled"),
            (self.without_zero, "rows not written: the daemon had no machine zero"),
            (self._received - rows - self.without_zero, "rows came and are not on the disk"),
        )
        losses = [f"{count} {what}" for count, what in counts if count]
        return ", ".join([parts, *losses])

    def _run(self) -> None:
        try:
            self._write_until_stopped()
        except CompdError as failure:
            self._failure = failure
        except OSError as error:
            self._failure = RecordingError.of(
                str(self._name.parent),
                f"cannot be written to: {error.strerror}",
                next_step="what was written before is whole, every row with its cycle; make room, and record "
                "under another name",
            )

    def _write_until_stopped(self) -> None:
        try:
            while not self._system.wait(self._stop, _WRITE_EVERY_S):
                self.write()
            self.write()
        finally:
            if self._parts:
                self._parts[-1].close()

    def write(self) -> None:
        """Write every queued line to the disk; called by the writing thread."""
        while self._waiting:
            item = self._waiting.popleft()
            message = item.message
            if message.get("class") == ORDER:
                if self._parts:
                    self._parts[-1].add_order(item.line)
                continue
            if "zero" not in message and self._parts:
                self._leave_out()
                continue
            part = self._part_for(item)
            part.add(item.line, message)
            for hash_, file in message.get("model_files", {}).items():
                if problem := part.copy_model(hash_, Path(file)):
                    self._report(f"the model file {file} {problem}: it is not kept, and replay will ask for it")
            if self._total_bytes() > self._limits.limit_bytes:
                self._at_limit()
        if self._parts:
            self._parts[-1].sync()

    def _leave_out(self) -> None:
        """Count a message without machine zero, of a daemon that started anew."""
        if not self.without_zero:
            self._report("the daemon has no machine zero now: nothing is recorded until `compd zero`")
        self.without_zero += 1

    def _part_for(self, item: FeedItem) -> RecordingPart:
        """The part that the message belongs to: a new one where the last is full, has another machine zero, or is of
        a daemon that has ended.
        """
        message = item.message
        if "zero" not in message:
            raise StateError.of(
                "the daemon",
                "has no machine zero, from which a recording's columns count",
                next_step="take it with `compd zero`, then record",
            )
        if not self._parts:
            self._origin_s = message["time_s"]
            return self._new_part(item)
        last, limits = self._parts[-1], self._limits
        if message["zero"] != last.zero:
            self._report("machine zero was taken anew")
        elif item.first_messages is not last.first_messages:
            pass  # whoever connected anew has said so
        elif last.size < limits.part_bytes and message["time_s"] - last.start_s < limits.part_s:
            return last
        last.close()
        return self._new_part(item)

    def _new_part(self, item: FeedItem) -> RecordingPart:
        message = item.message
        stem = self._name.with_name(f"{self._name.name}-{self._part_count + 1:04d}")
        age = timedelta(seconds=self._system.monotonic() - message["time_s"])
        started_at = (self._system.utc() - age).isoformat(timespec="milliseconds")
        machine_file = self._machine_file(item.first_messages[0])
        part = RecordingPart(
            stem, item.first_messages, message, self._origin_s, started_at, self._table_format, machine_file
        )
        self._parts.append(part)
        self._part_count += 1
        self._report(f"{part.path} begins")
        return part

    def _machine_file(self, version: Message) -> Path | None:
        """The file of the configuration, where the daemon runs with what it holds."""
        known = self._configuration
        if known is None:
            return None
        if known.config_hash != version["config_hash"]:
            self._report(f"the daemon runs with another configuration than {known.path}, which is not named")
            return None
        return known.path

    def _total_bytes(self) -> int:
        return sum(part.size for part in self._parts)

    def _at_limit(self) -> None:
        """Delete the oldest parts, or raise RecordingError to end the recording."""
        limit = f"{self._limits.limit_bytes / 1e6:g} MB"
        if not self._limits.drop_oldest:
            raise RecordingError.of(
                str(self._name),
                "the recording has reached its limit on disk and ends here",
                value=limit,
                next_step="give a larger limit, or let the oldest part be dropped",
            )
        while self._total_bytes() > self._limits.limit_bytes and len(self._parts) > 1:
            oldest = self._parts.pop(0)
            oldest.delete()
            self._rows_deleted += oldest.rows
            self._report(f"limit of {limit}: {oldest.path} deleted, with {oldest.rows} rows")
