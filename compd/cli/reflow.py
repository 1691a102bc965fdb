"""Text from source code with its line breaks, reflowed for a terminal of any width."""

from __future__ import annotations

import re

# Beginnings of separate lines: a list, a step, a key.
_OWN_LINE = re.compile(r"([-*]|\d+\.) |\S+:$")


def reflowed(text: str) -> str:
    """Paragraphs as one line each, for wrapping by the terminal; indented lines, lists and blank lines stay."""
    lines: list[str] = []
    for line in text.splitlines():
        continues = bool(lines and lines[-1].strip() and line.strip())
        if continues and not line.startswith(" ") and not lines[-1].startswith(" ") and not _OWN_LINE.match(line):
            lines[-1] = f"{lines[-1]} {line}"
        else:
            lines.append(line.rstrip())
    return "\n".join(lines)
