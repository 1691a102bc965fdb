"""What the loop asks of the system: priority, locked memory, precise timers, garbage collection between cycles."""

from __future__ import annotations

import ctypes
import gc
import os
import sys
from typing import NamedTuple

# /usr/include/x86_64-linux-gnu/bits/mman-linux.h; ONFAULT: pages stay once they are there, but thread
# stacks are not filled in advance.
_MCL_CURRENT, _MCL_FUTURE, _MCL_ONFAULT = 1, 2, 4
_CLOCK_MONOTONIC, _TIMER_ABSTIME = 1, 1  # linux/time.h
_EINTR = 4
_PR_SET_TIMERSLACK = 29  # linux/prctl.h

# How long another thread may keep the interpreter once the loop asks for it. Python's default of 5 ms is a whole
# period at 200 Hz.
SWITCH_INTERVAL_S = 50e-6
_PYTHON_SWITCH_INTERVAL_S = 5e-3
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


def shorten_switch_interval() -> Permission:
    """Let a thread have the interpreter soon after it asks for it."""
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    return Permission(True, f"{SWITCH_INTERVAL_S * 1e6:g} us")


def restore_switch_interval() -> None:
    """Set Python's default again."""
    sys.setswitchinterval(_PYTHON_SWITCH_INTERVAL_S)


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

    def stop(self) -> None:
        """Switch automatic collection on again."""
        gc.enable()
        gc.unfreeze()
