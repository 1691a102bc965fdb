"""A question to a worker, and its answer once it is there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any


@dataclass(eq=False)
class Asked:
    """One question.

    question : "package.module:function", or "package.module:Class.method", of what gets the worker's state first. It is
        named, so that the server imports none of it. given : its further arguments, plain data.
    seconds : that the answer may take. progress : called with each step that is told, by the worker's thread.
    answer : bytes that are ready to be sent, or the exception.
    is_cancelled : whether the question was abandoned.
    """

    question: str
    given: Sequence[Any]
    seconds: float
    progress: Callable[[str], None] | None = None
    answer: Future[bytes] = field(default_factory=Future)
    is_cancelled: bool = False
