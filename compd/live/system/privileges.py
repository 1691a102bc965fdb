"""What the processes ask of the computer for real time, and what they get."""

from __future__ import annotations

import os
import threading
import traceback

from compd.live.system.forked_process import OUT_OF_MEMORY
from compd.live.system.memory_limit import limit_memory
from compd.live.system.realtime import (
    QuietCollector,
    RationedPriority,
    limit_wake_latency,
    lock_memory,
    sharpen_timers,
    shorten_switch_interval,
    use_fifo,
)


class Privileges:
    """What this computer grants. Each is asked for by the process or thread that wants it."""

    sharpen_timers = staticmethod(sharpen_timers)
    use_fifo = staticmethod(use_fifo)
    lock_memory = staticmethod(lock_memory)
    limit_wake_latency = staticmethod(limit_wake_latency)
    limit_memory = staticmethod(limit_memory)
    shorten_switch_interval = staticmethod(shorten_switch_interval)
    rationed_priority = RationedPriority
    quiet_collector = QuietCollector

    @staticmethod
    def end_with_any_thread() -> None:
        """Let an exception in any thread of this process end the process."""
        threading.excepthook = _end_with_thread


def _end_with_thread(arguments: threading.ExceptHookArgs) -> None:
    if isinstance(arguments.exc_value, MemoryError):
        os._exit(OUT_OF_MEMORY)
    traceback.print_exception(arguments.exc_value)
    os._exit(1)
