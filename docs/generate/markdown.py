"""Pieces of Markdown that the pages share. This module is no page: it has no function `page`."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path

GLOSSARY = Path(__file__).parent.parent / "glossary.md"
_CODE_SPAN = re.compile(r"(``.+?``|`[^`]+`)", re.DOTALL)
# The beginning of an item of a list.
_ITEM = re.compile(r"(?:[-*]|\d+\.) ")
_SPECIAL = re.compile(r"([\\*<\[\]$])")


def escape(text: str) -> str:
    """Text of a docstring or a description, so that nothing but `code` in it is markup."""
    parts = _CODE_SPAN.split(text)
    return "".join(part if index % 2 else _SPECIAL.sub(r"\\\1", part) for index, part in enumerate(parts))


def code(text: object) -> str:
    """A code span; "" for an empty text."""
    shown = str(text)
    if not shown:
        return ""
    return f"`` {shown} ``" if "`" in shown else f"`{shown}`"


def codes(texts: Iterable[object]) -> str:
    """Code spans with commas between."""
    return ", ".join(map(code, texts))


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table; its cells are Markdown."""
    lines = [header, ["---"] * len(header), *rows]
    return "".join(f"| {' | '.join(map(_cell, line))} |\n" for line in lines)


def fence(text: str, language: str = "text") -> str:
    """A block of code."""
    return f"```{language}\n{text.rstrip()}\n```\n"


def heading(level: int, text: str, target: str = "") -> str:
    """A heading, with a target that `[text](#target)` finds in all of the documentation."""
    return (f"({target})=\n" if target else "") + f"{'#' * level} {text}\n"


def link(text: str, target: str) -> str:
    """A link to a heading's target."""
    return f"[{text}](#{target})"


def term(name: str, shown: str = "") -> str:
    """A link to a term of the glossary, where the glossary has it; else the words alone."""
    words = shown or name
    return f"{{term}}`{words} <{name}>`" if name in _glossary() else words


@cache
def _glossary() -> frozenset[str]:
    """The terms of the glossary: the lines of its `{glossary}` blocks that are not indented."""
    text = GLOSSARY.read_text(encoding="utf-8")
    blocks = re.findall(r"^```\{glossary\}\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    return frozenset(line for block in blocks for line in block.split("\n") if line[:1].strip())


def target(*parts: str) -> str:
    """The name of a heading's target: unique in the documentation where the first part is the page's name."""
    return re.sub(r"[^a-z0-9]+", "-", "-".join(parts).lower()).strip("-")


def prose(text: str) -> str:
    """A docstring: paragraphs and lists as they are, what is indented as a block of code."""
    blocks: list[str] = []
    for indented, lines in _runs(text.strip("\n").split("\n")):
        while lines and not lines[-1].strip():
            lines.pop()
        if indented:
            blocks.append(fence(_dedent(lines)))
        elif any(line.strip() for line in lines):
            blocks.append(escape(re.sub(r"::$", ":", "\n".join(lines).strip("\n"))) + "\n")
    return "\n".join(blocks)


def sentence(text: str) -> str:
    """A description as a sentence of its own: capital first, full stop last."""
    stripped = text.strip()
    if stripped[:1].islower():
        stripped = stripped[0].upper() + stripped[1:]
    return stripped if stripped.endswith((".", "?", ":")) else stripped + "."


def join(*blocks: str) -> str:
    """A page or a part of one: blocks with a blank line between, empty ones left out."""
    return "\n\n".join(block.strip("\n") for block in blocks if block.strip()) + "\n"


def _cell(text: str) -> str:
    return re.sub(r"(?<!\\)\|", r"\\|", " ".join(text.split("\n")))


def _runs(lines: Sequence[str]) -> list[tuple[bool, list[str]]]:
    """The lines in runs that are indented or not; a blank line belongs to the run that it stands in.

    A line that continues an item of a list is not indented.
    """
    runs: list[tuple[bool, list[str]]] = []
    in_item = False
    for line in lines:
        indented = bool(re.match(r" {2,}\S", line)) if line.strip() else (runs[-1][0] if runs else False)
        in_item = bool(_ITEM.match(line)) or (in_item and indented and bool(line.strip()))
        indented = indented and not in_item
        if not runs or runs[-1][0] != indented:
            runs.append((indented, []))
        runs[-1][1].append(line)
    return runs


def _dedent(lines: Sequence[str]) -> str:
    margin = min(len(line) - len(line.lstrip()) for line in lines if line.strip())
    return "\n".join(line[margin:] for line in lines)
