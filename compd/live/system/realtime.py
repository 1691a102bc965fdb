"""What the processes ask of the system: priority, locked memory, precise timers; garbage collection on demand."""

from __future__ import annotations

import ctypes
import gc
import math
import os
import struct
import sys
import time
from pathlib import Path
from typing import NamedTuple

from compd.clock import Clock

# /usr/include/x86_64-linux-gnu/bits/mman-linux.h; ONFAULT: pages stay once they are there, but thread
# stacks are not filled in advance.
_MCL_CURRENT, _MCL_FUTURE, _MCL_ONFAULT = 1, 2, 4
_CLOCK_MONOTONIC, _TIMER_ABSTIME = 1, 1  # linux/time.h
_EINTR = 4
_PR_SET_TIMERSLACK = 29  # linux/prctl.h

WAKE_LATENCY_DEVICE = Path("/dev/cpu_dma_latency")

# How long another thread of a process may keep the interpreter once one asks for it; Python's default is 5 ms.
SWITCH_INTERVAL_S = 50e-6
# A thread with priority that takes more of a processor than this would keep others from theirs: from the gauges, and
# with the kernel's limit for all real-time threads (95 %) even the loop.
MAX_SHARE = 0.5
_RATION_EVERY_S = 0.1
# Exceptions in drivers leave reference cycles of a few kB each; collected at this interval they stay within a few MB.
_COLLECT_EVERY_S = 5.0

_libc = ctypes.CDLL(None, use_errno=True)


class _Timespec(ctypes.Structure):
    _fields_ = (("seconds", ctypes.c_long), ("nanoseconds", ctypes.c_long))


_libc.clock_nanosleep.argtypes = (ctypes.c_int, ctypes.c_int, ctypes.POINTER(_Timespec), ctypes.c_void_p)


class Permission(NamedTuple):
    """Whether the system granted a request, and details for people."""

    granted: bool
    detail: str


def sleep_until(time_s: float) -> None:
    """Sleep until an absolute time on CLOCK_MONOTONIC (clock_nanosleep(2)), through any signal, without the GIL.

    Absolute times do not drift: the duration of a cycle is not added to its period.
    """
    seconds = int(time_s)
    wake = _Timespec(seconds, int((time_s - seconds) * 1e9))
    while (error := _libc.clock_nanosleep(_CLOCK_MONOTONIC, _TIMER_ABSTIME, ctypes.byref(wake), None)) != 0:
        if error != _EINTR:
            raise OSError(error, os.strerror(error))


def sharpen_timers() -> None:
    """Set the timer slack of the calling thread, and of threads it starts, from the kernel's 50 us to 1 ns.

    prctl(2), PR_SET_TIMERSLACK; needs no privilege. On a fast line 50 us is a tenth of a polling round.
    """
    _libc.prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)


def use_fifo(priority: int) -> Permission:
    """Give the calling thread, and no other, the scheduling policy SCHED_FIFO with this priority."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError as error:
        return Permission(False, f"{error.strerror}; needs CAP_SYS_NICE or LimitRTPRIO={priority}")
    return Permission(True, f"priority {priority}")


def lock_memory() -> Permission:
    """Keep all pages of the process in memory, mlockall(2)."""
    if _libc.mlockall(_MCL_CURRENT | _MCL_FUTURE | _MCL_ONFAULT) != 0:
        return Permission(False, f"{os.strerror(ctypes.get_errno())}; needs CAP_IPC_LOCK or LimitMEMLOCK=infinity")
    return Permission(True, "all pages, as they are touched")


def limit_wake_latency(latency_us: int, device: Path = WAKE_LATENCY_DEVICE) -> Permission:
    """Let no processor sleep so deeply that it takes longer than this (us) to wake; 0 for not at all.

    The kernel's PM QoS (Documentation/power/pm_qos_interface.rst): the limit holds as long as the file stays open, so
    it is not closed before this process ends. Between two cycles at 1 kHz a processor would fall asleep, and to wake it
    takes 20 to 50 us each for loop, service and client.
    """
    try:
        file = os.open(device, os.O_WRONLY | os.O_CLOEXEC)
        os.write(file, struct.pack("=i", latency_us))
    except OSError as error:
        return Permission(False, f"{device}: {error.strerror}; needs systemd/compd.rules")
    return Permission(True, f"processors wake within {latency_us} us")


def shorten_switch_interval() -> None:
    """Let a thread have the interpreter soon after it asks for it."""
    sys.setswitchinterval(SWITCH_INTERVAL_S)


def thread_time_s(thread_id: int) -> float:
    """Processor time (s) of a thread of this process, by the kernel's id. OSError where there is none.

    The clock's id as glibc's pthread_getcpuclockid makes it, which wants a thread that is alive.
    """
    return time.clock_gettime(~thread_id << 3 | 6)


class RationedPriority:
    """SCHED_FIFO for a thread that serves others, as long as it takes no more than its share of a processor.

    A client that asks without end then slows down itself and the other clients, and nothing else; a driver that never
    waits slows down its own process.
    """

    def __init__(
        self, priority: int, clock: Clock, thread_id: int | None = None, largest_share: float = MAX_SHARE
    ) -> None:
        """`priority`: below the loop's; 0 for none. `thread_id`: as the kernel counts; None: the thread that looks."""
        self._priority = priority
        self._clock = clock
        self._thread_id = thread_id
        self._largest_share = largest_share
        self._next_s = -math.inf
        self._last_s = self._used_s = 0.0
        self.has_priority = False

    def look(self) -> None:
        """Give the priority, or take it away; called often."""
        now_s = self._clock.monotonic()
        if now_s < self._next_s or not self._priority:
            return
        try:
            used_s = time.thread_time() if self._thread_id is None else thread_time_s(self._thread_id)
        except OSError:  # the thread has ended
            self._priority = 0
            return
        wanted = used_s - self._used_s <= self._largest_share * (now_s - self._last_s)
        self._next_s, self._last_s, self._used_s = now_s + _RATION_EVERY_S, now_s, used_s
        if wanted != self.has_priority:
            # threads that this one starts have no priority
            policy = (os.SCHED_FIFO if wanted else os.SCHED_OTHER) | os.SCHED_RESET_ON_FORK
            try:
                os.sched_setscheduler(self._thread_id or 0, policy, os.sched_param(self._priority if wanted else 0))
            except OSError:
                self._priority = 0  # not permitted, now or later, or the thread has ended
            else:
                self.has_priority = wanted


class QuietCollector:
    """The garbage collector, run after a cycle of the loop and never within one."""

    def __init__(self) -> None:
        self._next_s = 0.0

    def start(self, now_s: float) -> Permission:
        """Exempt all objects that exist now, and switch automatic collection off."""
        gc.collect()
        gc.freeze()
        gc.disable()
        self._next_s = now_s + _COLLECT_EVERY_S
        return Permission(True, f"{gc.get_freeze_count()} objects frozen, collected in the loop's slack")

    def collect_if_due(self, now_s: float) -> None:
        """Collect, if the interval has passed; called between two cycles."""
        if now_s >= self._next_s:
            self._next_s = now_s + _COLLECT_EVERY_S
            gc.collect()
