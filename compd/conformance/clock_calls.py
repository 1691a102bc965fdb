"""Calls of the computer's clock functions: a driver must use the line's clock."""

from __future__ import annotations

import gc
import select
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

CLOCK_FUNCTIONS = (
    "sleep", "time", "time_ns", "monotonic", "monotonic_ns", "perf_counter", "perf_counter_ns", "process_time",
    "clock_gettime",
)  # fmt: skip
WAITS_OF_THREADS = [function.__code__ for function in (threading.Condition.wait, threading.Thread.join)]


@contextmanager
def clock_calls() -> Iterator[list[str]]:
    """Names of the clock functions called during the block."""
    called: list[str] = []
    watched = {id(getattr(time, name)): f"time.{name}" for name in CLOCK_FUNCTIONS}
    watched[id(select.select)] = "select.select"

    def note(frame: FrameType, event: str, function: Any) -> None:
        if event == "call" and frame.f_code in WAITS_OF_THREADS:
            called.append(f"threading's {frame.f_code.co_qualname}")
        elif event == "c_call":
            name = watched.get(id(function), "")
            if getattr(function, "__qualname__", "") in ("datetime.now", "datetime.utcnow"):
                name = function.__qualname__
            if name:
                called.append(name)

    if sys.getprofile() is not None:  # a profiler is active, and only one is possible
        yield called
        return
    collecting = gc.isenabled()
    gc.disable()  # calls by a garbage collection are not the driver's
    sys.setprofile(note)
    try:
        yield called
    finally:
        sys.setprofile(None)
        if collecting:
            gc.enable()
