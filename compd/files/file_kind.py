"""Kinds of files, and when a file counts as one of its kind: before that, no message quotes anything of it.

The path of any file may be given by mistake, or by somebody who may not read it himself. A message about a file that
is not what it should be therefore says what it is not, where, and what is allowed; it has no value, no key and no line
of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from compd.errors import Problem


@dataclass(frozen=True)
class FileKind:
    """A kind of file that holds a mapping, or a list of them."""

    name: str  #: with its article, "a model file"
    keys: frozenset[str]  #: those that make a file one of this kind; `least` of them must be there
    least: int
    #: further keys that it may have. Most of the keys of a file must be among `keys` and these.
    others: frozenset[str] = frozenset()
    next_step: str = ""  #: where such a file comes from
    #: the key under which there may be several such mappings; a list of them may also be the whole file
    listed_under: str = ""

    def recognises(self, data: Any) -> bool:
        """Whether the content of a file is of this kind, right or wrong in its parts."""
        if self.listed_under:
            if isinstance(data, Mapping) and self.listed_under in data:
                data = data[self.listed_under]
            if isinstance(data, list):
                return not data or any(map(self._is_one, data))
            if data is None:
                return True
        return self._is_one(data)

    def _is_one(self, data: Any) -> bool:
        if not isinstance(data, Mapping):
            return False
        known = sum(key in self.keys or key in self.others for key in data)
        return sum(key in data for key in self.keys) >= self.least and 2 * known >= len(data)

    def refused(self, where: Path | str) -> Problem:
        """The problem of a file that is not of this kind. where : the file, or file:line."""
        count = "" if self.least == len(self.keys) else f"at least {self.least} of "
        return Problem(
            str(where),
            f"is not {self.name}",
            allowed=f"`key: value` lines with {count}{', '.join(sorted(self.keys))}",
            next_step=self.next_step or f"give the path of {self.name}",
        )


def without_values(problems: Sequence[Problem]) -> list[Problem]:
    """The same problems of a file that has not been recognised: where and what, and no value of it."""
    return [
        Problem(problem.where, problem.what, allowed=problem.allowed, next_step=problem.next_step)
        for problem in problems
    ]
