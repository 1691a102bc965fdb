"""Labelled texts in few lines: what a person reads first, cut where it does not fit, the most important kept.

Example::

    texts = [LabelledText("Found", ("backlash: play in the screw",)), LabelledText("Next", ("add it",))]
    fit_lines(texts, most=12, width=80)  # ["Found: backlash: play in the screw", "Next:  add it"]
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from textwrap import wrap

ELLIPSIS = "..."
MORE = "more below"


@dataclass(frozen=True)
class LabelledText:
    """A label and what stands behind it."""

    label: str  #: one word or two
    clauses: tuple[str, ...]  #: what is said, the most important first; the last are left out where there is no room
    #: empty: the clauses follow one another, with semicolons. One for each clause: each clause has a line of its own,
    #: and those without room are mentioned by their names.
    names: tuple[str, ...] = ()
    least: int = 1  #: lines that it has at least

    def lines(self, most: int, width: int) -> list[str]:
        """The text without its label in at most so many lines of so many columns."""
        return self._listed(most, width) if self.names else _running(self.clauses, most, width)

    def _listed(self, most: int, width: int) -> list[str]:
        if most < len(self.clauses):
            shown = [_running((clause,), 1, width)[0] for clause in self.clauses[: most - 1]]
            others = ", ".join(self.names[most - 1 :])
            return [*shown, *_running((f"also {others}" if shown else others,), 1, width)]
        spare, result = most - len(self.clauses), []
        for clause in self.clauses:
            lines = _running((clause,), 1 + spare, width - 2)
            spare -= len(lines) - 1
            result += [lines[0], *(f"  {line}" for line in lines[1:])]
        return result


def fit_lines(texts: Sequence[LabelledText], most: int, width: int) -> list[str]:
    """All texts, each with its label before its first line, in at most `most` lines of `width` columns.

    Each text has its `least` lines, which together must not be more than `most`; spare lines go round among the texts
    that are cut, the last text first: it says what to do.
    """
    indent = max((len(text.label) for text in texts), default=0) + 2
    room = width - indent
    counts = [text.least for text in texts]
    wanted = [len(text.lines(most, room)) for text in texts]
    while sum(counts) < most:
        cut = [k for k in range(len(texts)) if counts[k] < wanted[k]]
        if not cut:
            break
        counts[min(reversed(cut), key=lambda k: counts[k] - texts[k].least)] += 1
    result = []
    for text, count in zip(texts, counts, strict=True):
        first, *others = text.lines(count, room)
        result += [f"{text.label + ':':<{indent}}{first}", *(" " * indent + line for line in others)]
    return result


def _running(clauses: Sequence[str], most: int, width: int) -> list[str]:
    """Clauses one after the other; at the end those are missing for which there is no room."""
    for kept in range(len(clauses), 0, -1):
        shown = [*clauses[:kept], *([MORE] if kept < len(clauses) else [])]
        lines = wrap("; ".join(shown), width, break_on_hyphens=False)
        if len(lines) <= most:
            return lines
    lines = wrap(clauses[0], width, break_on_hyphens=False)
    return [*lines[: most - 1], _cut(" ".join(lines[most - 1 :]), width)]


def _cut(line: str, width: int) -> str:
    """The line with an ellipsis at its end, cut between words unless one of them takes half of it."""
    room = width - len(ELLIPSIS)
    if len(line) > room:
        words = line[:room].rsplit(" ", 1)[0]
        line = words if len(words) > room / 2 else line[:room]
    return line.rstrip(" ,;:(") + ELLIPSIS
