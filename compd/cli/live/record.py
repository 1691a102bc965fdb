"""`compd record`: raw readings from the running daemon onto the disk."""

from __future__ import annotations

import signal
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from compd.cli.options import DEFAULT_SOCKET, DaemonOption, unix_address
from compd.tables import TableFormat

_MB = 1_000_000
_S_PER_H = 3600.0
# The daemon is gone when it has said nothing for this long, or for three intervals.
_TIMEOUT_S = 5.0


class WhenFull(StrEnum):
    """What happens at the limit."""

    STOP = "stop"
    DROP_OLDEST = "drop-oldest"


def record(
    name: Annotated[
        Path,
        typer.Argument(help="Where to: NAME becomes NAME-0001.csv and so on, with --format parquet NAME-0001.parquet."),
    ],
    address: DaemonOption = DEFAULT_SOCKET,
    rate_hz: Annotated[float, typer.Option(min=0.001, help="Rows per second; the cycles between are left out.")] = 10.0,
    burst: Annotated[
        float | None, typer.Option(min=0.001, help="Every cycle, for so many seconds; another recorder may run beside.")
    ] = None,
    seconds: Annotated[float | None, typer.Option(min=0.001, help="End after so long; otherwise at Ctrl-C.")] = None,
    part_mb: Annotated[float, typer.Option(min=0.01, help="Begin a new part after so many MB.")] = 100.0,
    part_hours: Annotated[float, typer.Option(min=0.0001, help="Begin a new part after so many hours.")] = 24.0,
    limit_mb: Annotated[float, typer.Option(min=0.01, help="All parts together; see --when-full.")] = 5000.0,
    when_full: Annotated[
        WhenFull, typer.Option(help="At the limit: end the recording, or delete its oldest part and say so.")
    ] = WhenFull.STOP,
    table_format: Annotated[
        TableFormat,
        typer.Option(
            "--format",
            help="Of the table. A part of Parquet is NAME-0001.arrow until it is closed; what a kill leaves of it is "
            "closed by the next `compd record` of the name, or by `compd recording convert`.",
        ),
    ] = TableFormat.CSV,
) -> None:
    """Record raw readings, never corrected ones, from the running daemon: table, sidecar, and all that a replay needs.

    When the daemon ends and starts again, the recording goes on in a new part.
    """
    from compd.cli.progress import ElapsedShown
    from compd.client import connect
    from compd.clock import MonotonicClock
    from compd.live.record import ReadingsFeed, Recorder, RecordingLimits

    keeping = RecordingLimits(
        round(part_mb * _MB), part_hours * _S_PER_H, round(limit_mb * _MB), when_full is WhenFull.DROP_OLDEST
    )
    for_s = burst if burst is not None else seconds
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    clock, socket_path = MonotonicClock(), unix_address(address)
    with ElapsedShown(for_s, clock) as shown:
        feed = ReadingsFeed(
            lambda: connect(socket_path, max(_TIMEOUT_S, 3 / rate_hz)),
            None if burst is not None else rate_hz,
            shown.say,
            clock,
        )
        recorder = Recorder(name, *feed.first_messages, keeping, shown.say, clock, table_format)
        recorder.start()
        try:
            recorder.follow(shown.show(feed.messages(for_s), lambda: f"{recorder.rows} rows"))
        except KeyboardInterrupt:
            pass  # the usual end
        finally:
            try:
                recorder.close()
            finally:
                shown.say(recorder.summary())
