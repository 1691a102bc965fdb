"""Limits of one worker: memory, and time for an answer; and the messages about exceeding them."""

from __future__ import annotations

from dataclasses import dataclass

from compd.errors import StateError

_ELSEWHERE = "take less at once; or use the command line, which has no such limit"


@dataclass(frozen=True)
class WorkerLimits:
    """Limits of one worker.

    memory_mb : beyond what a new process has, MB. opening_s : to open its state, beside the time of the question.
    idle_s : without a question after which its process ends, so that its memory returns.
    """

    memory_mb: float
    opening_s: float = 60.0
    idle_s: float = 120.0


def too_long(where: str, allowed_s: float) -> StateError:
    """The problem of a question beyond its time limit. allowed_s : for its answer, s."""
    what = "it took longer than it may, and was ended"
    return StateError.of(where, what, allowed=f"{allowed_s:g} s", next_step=_ELSEWHERE)


def too_large(where: str, memory_mb: float) -> StateError:
    """The problem of a process that ran out of memory."""
    what = f"it needs more than {memory_mb:g} MB, and was ended"
    return StateError.of(where, what, allowed=f"{memory_mb:g} MB", next_step=_ELSEWHERE)


def killed(where: str, memory_mb: float) -> StateError:
    """The problem of a process that has ended without a message."""
    what = f"its process was killed, as the system does where memory is short; it may use {memory_mb:g} MB"
    return StateError.of(where, what, next_step="try it again")


def cancelled(where: str) -> StateError:
    """The problem of an abandoned question."""
    return StateError.of(where, "it was cancelled")


def too_many(where: str, most: int, whose: str = "") -> StateError:
    """The problem of a reached limit: all that may run, or be open, is busy. whose : see `Share`."""
    what = "the page computes as much as it may already"
    step = "wait until something has ended, or cancel it where it was begun"
    return StateError.of(where, what, allowed=f"{most} at once {whose}".rstrip(), next_step=step)


def none_left(where: str) -> StateError:
    """The problem of a system that allows the page no further thread or process."""
    what = "the system lets the page start no further process"
    step = "wait until something has ended; in systemd, see `TasksMax` and `MemoryMax` of the page's unit"
    return StateError.of(where, what, next_step=step)
