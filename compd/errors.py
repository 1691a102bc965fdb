"""Errors that say what is wrong, where, the value, what is allowed and the next step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

from compd.text import without_users


@dataclass(frozen=True)
class Problem:
    """One thing a person can mend.

    Attributes
    ----------
    where : str
        File, line and key, or device and channel: the place to go to.
    what : str
        What is wrong there, in one clause.
    value : str
        The offending value as the person wrote it, or ``""`` where there is none.
    allowed : str
        What would be right.
    next_step : str
        What to do now.
    """

    where: str
    what: str
    value: str = ""
    allowed: str = ""
    next_step: str = ""

    def __post_init__(self) -> None:
        # user and password of a URL are nobody's to read
        for name in ("where", "what", "value"):
            object.__setattr__(self, name, without_users(getattr(self, name)))

    def __str__(self) -> str:
        parts = [f"{self.where}: {self.what}"]
        if self.value:
            parts.append(f"value: {self.value}")
        if self.allowed:
            parts.append(f"allowed: {self.allowed}")
        if self.next_step:
            parts.append(f"next: {self.next_step}")
        return "\n    ".join(parts)


class CompdError(Exception):
    """Base of every error that compd raises on purpose; it carries all its problems at once.

    Attributes
    ----------
    problems : tuple of Problem
        Each with the place, what is wrong there, the value, what is allowed and what to do.
    """

    def __init__(self, problems: Problem | Sequence[Problem]) -> None:
        self.problems: tuple[Problem, ...] = (problems,) if isinstance(problems, Problem) else tuple(problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))

    @classmethod
    def of(cls, where: str, what: str, *, value: str = "", allowed: str = "", next_step: str = "") -> Self:
        """One error of one problem; the parts as in `Problem`."""
        return cls(Problem(where, what, value, allowed, next_step))

    def __reduce__(self) -> tuple[type[CompdError], tuple[tuple[Problem, ...]]]:
        return type(self), (self.problems,)


class ConfigurationError(CompdError):
    """The configuration cannot be used; every problem in it is listed."""


class KinematicsError(CompdError):
    """A pose or frame that cannot be computed: unreachable, near-singular, not finite."""


class PluginError(CompdError):
    """A driver or effect that cannot be loaded."""


class StateError(CompdError):
    """What is on disk (machine zero, model file) does not fit this machine."""


class RecordingError(CompdError):
    """A recording, its sidecar or an instrument's export that cannot be used; every problem is listed."""


class DaemonError(CompdError):
    """The daemon cannot be reached, or refused a request."""
