"""What a world sees of its daemons: that they begin and end, their setpoints, their log."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any
from unittest.mock import patch

import structlog

from compd.live.daemon import Daemon
from compd.live.loop import Loop

if TYPE_CHECKING:
    from tests.worlds.world import World


@contextmanager
def observed(world: World) -> Iterator[None]:
    """Daemons and loops tell their world of themselves."""

    class ObservedDaemon(Daemon):
        def __init__(self, *arguments: Any, **named: Any) -> None:
            super().__init__(*arguments, **named)
            world.begun(self)

        def close(self, after: Daemon | None = None) -> None:
            super().close(after)
            world.closed(self)

    class ObservedLoop(Loop):
        def __init__(self, cycle: Any, latest: Any, commands: Any, sinks: Any, *arguments: Any) -> None:
            super().__init__(cycle, latest, commands, [*sinks, world.note], *arguments)
            world.cycle = cycle

    with (
        patch("compd.live.run_daemon.Daemon", ObservedDaemon),
        patch("compd.live.processes.loop_process.Loop", ObservedLoop),
    ):
        yield


@contextmanager
def logged(world: World) -> Iterator[None]:
    """The daemon's log goes to its world."""

    def note(_logger: Any, _method: str, entry: Any) -> Any:
        world.log.append({**entry, "time_s": world.hub.now_s})
        raise structlog.DropEvent

    before = structlog.get_config()
    structlog.configure(
        processors=[structlog.processors.add_log_level, structlog.processors.format_exc_info, note],
        cache_logger_on_first_use=False,
    )
    try:
        yield
    finally:
        structlog.configure(**before)
