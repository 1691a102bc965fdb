"""`compd recording start`: record raw readings of the running daemon."""

from __future__ import annotations

import signal
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from compd.cli.options import DEFAULT_SOCKET, DaemonOption, daemon_configuration
from compd.tables import TableFormat

_MB = 1_000_000
_S_PER_H = 3600.0
# Silence (s) after which the daemon counts as gone; at least three intervals.
_TIMEOUT_S = 5.0


class WhenFull(StrEnum):
    """Action at the limit."""

    STOP = "stop"
    DROP_OLDEST = "drop-oldest"


def start(
    name: Annotated[
        Path,
        typer.Argument(
            help="Name of the files: NAME becomes NAME-0001.csv ..., with --format parquet NAME-0001.parquet."
        ),
    ],
    daemon: DaemonOption = DEFAULT_SOCKET,
    rate_hz: Annotated[float, typer.Option(min=0.001, help="Rows per second; the cycles between are left out.")] = 10.0,
    burst: Annotated[
        float | None, typer.Option(min=0.001, help="Record every cycle for this many seconds; other recorders may run.")
    ] = None,
    seconds: Annotated[
        float | None, typer.Option(min=0.001, help="End after this many seconds; default: at Ctrl-C.")
    ] = None,
    part_mb: Annotated[float, typer.Option(min=0.01, help="Begin a new part after this many MB.")] = 100.0,
    part_hours: Annotated[float, typer.Option(min=0.0001, help="Begin a new part after this many hours.")] = 24.0,
    limit_mb: Annotated[
        float, typer.Option(min=0.01, help="Limit (MB) of all parts together; see --when-full.")
    ] = 5000.0,
    when_full: Annotated[
        WhenFull, typer.Option(help="At the limit: end the recording, or delete its oldest part with a message.")
    ] = WhenFull.STOP,
    table_format: Annotated[
        TableFormat,
        typer.Option(
            "--format",
            help="Format of the table. A part of Parquet is NAME-0001.arrow until it is closed; an interrupted one is "
            "closed by the next `compd recording start` of the name, or by `compd recording convert`.",
        ),
    ] = TableFormat.CSV,
) -> None:
    """Record raw, uncorrected readings from the running daemon: table, sidecar, and all input of a replay.

    When the daemon ends and starts again, the recording goes on in a new part. With `--daemon FILE.yaml` the sidecars
    name that file as the machine's, and later commands need no `--machine`.
    """
    from compd.cli.progress import ElapsedShown
    from compd.client import connect
    from compd.live.record import ReadingsFeed, Recorder, RecordingLimits
    from compd.live.system import THIS_COMPUTER

    keeping = RecordingLimits(
        round(part_mb * _MB), part_hours * _S_PER_H, round(limit_mb * _MB), when_full is WhenFull.DROP_OLDEST
    )
    for_s = burst if burst is not None else seconds
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    configuration = daemon_configuration(daemon)
    socket_path = daemon if configuration is None else configuration.sockets.unix.path
    with ElapsedShown(for_s, THIS_COMPUTER) as shown:
        feed = ReadingsFeed(
            lambda: connect(socket_path, max(_TIMEOUT_S, 3 / rate_hz)),
            None if burst is not None else rate_hz,
            shown.say,
            THIS_COMPUTER,
        )
        recorder = Recorder(name, *feed.first_messages, keeping, shown.say, THIS_COMPUTER, table_format, configuration)
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
