"""Texts in answers to a browser with the signs of print: a person reads "µm" where files and messages have "um"."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from compd.text import typeset

# Fields that are read: of a comparison, an effect, a diagnosis, a plan, a join, the daemon's messages and refusals.
SHOWN = frozenset(
    {
        *("verdict", "trends", "faults", "floor_how", "left_out", "warning", "differ"),
        *("why", "why_not", "noise", "physics", "equation", "symbols", "source", "separated_by", "meaning"),
        *("lines", "text", "facts", "follows", "constant", "gross", "tried", "untested", "next", "range"),
        *("summary", "instructions"),
        *("problems", "assumed", "by_not_clear"),
        *("reason", "detail", "last_words", "waits_for_person", "not_believed"),
    }
)
# Fields that are copied or computed with, whatever is in them: formulas, commands, a diagnosis as a program
# reads it and as the terminal prints it.
VERBATIM = frozenset({"formulas", "saved", "command", "commands", "plan_command", "result", "printed"})


def shown(answer: Any) -> Any:
    """Plain data with `typeset` texts in the fields that are read; names, units, commands and formulas stay."""
    if isinstance(answer, Mapping):
        return {name: _field(name, value) for name, value in answer.items()}
    if isinstance(answer, list | tuple):
        return [shown(value) for value in answer]
    return answer


def _field(name: str, value: Any) -> Any:
    if name in VERBATIM:
        return value
    return _typeset_all(value) if name in SHOWN else shown(value)


def _typeset_all(value: Any) -> Any:
    """The value with each text in it typeset, and the names of a mapping's values; a list may have `shown` entries."""
    if isinstance(value, str):
        return typeset(value)
    if isinstance(value, Mapping):
        return {typeset(name): _typeset_all(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [shown(part) if isinstance(part, Mapping) else _typeset_all(part) for part in value]
    return value
