"""Problems and warnings on a terminal: wrapped between words, with indented parts."""

from __future__ import annotations

import shutil
import sys
import textwrap
from collections.abc import Iterable
from typing import TextIO

from compd.errors import Problem

_INDENT = "    "


def print_problems(problems: Iterable[Problem], mark: str = "", stream: TextIO | None = None) -> None:
    """Print problems; on a terminal within its width, elsewhere one part a line. mark : before each, as "warning: "."""
    stream = stream or sys.stderr
    width = shutil.get_terminal_size().columns if stream.isatty() else 0
    for problem in problems:
        print(wrapped(f"{mark}{problem}", width), file=stream)


def wrapped(text: str, width: int) -> str:
    """Each line of `text` within `width` columns, with a hanging indent; 0 columns: unchanged."""
    if not width:
        return text
    lines: list[str] = []
    for line in text.splitlines():
        own = line[: len(line) - len(line.lstrip())]
        lines += textwrap.wrap(
            line.strip(),
            width - 1,
            initial_indent=own,
            subsequent_indent=own + _INDENT,
            # a path or key that is broken cannot be copied
            break_long_words=False,
            break_on_hyphens=False,
        )
    return "\n".join(lines)
