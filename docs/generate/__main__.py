"""Write the generated pages, which are kept in the repository: `python -m docs.generate`."""

from __future__ import annotations

import importlib
import pkgutil
import re
from pathlib import Path

import docs.generate

REFERENCE = Path(__file__).parent.parent / "reference"
# Written by `python -m docs.gallery`, which takes a minute.
GALLERY_CASES = Path(__file__).parent.parent / "gallery" / "cases.md"

# The page with examples from a running daemon, which are other ones each time.
PROTOCOL = "protocol"


def page_names() -> list[str]:
    """The modules that are pages, sorted: those with a function `page`; the others hold what pages share."""
    modules = sorted(module.name for module in pkgutil.iter_modules(docs.generate.__path__))
    return [name for name in modules if hasattr(importlib.import_module(f"docs.generate.{name}"), "page")]


def page_of(name: str) -> str:
    """The text of one page, by the name of its module."""
    text: str = importlib.import_module(f"docs.generate.{name}").page()
    return text


def file_of(name: str) -> Path:
    """Where the page of that module is kept."""
    return REFERENCE / f"{name.replace('_', '-')}.md"


def without_values(text: str) -> str:
    """The page without what a running daemon measured for its examples: numbers, times, hashes, temporary files."""
    return re.sub(r"/tmp/[\w-]+|\b[0-9a-f]{16}\b|-?\b\d[\w.:+-]*", "0", text)


def main() -> None:
    """Write every page that has changed: Sphinx builds no more than it must, and git sees no other values."""
    for name in page_names():
        text = page_of(name)
        path = file_of(name)
        kept = path.read_text(encoding="utf-8") if path.exists() else ""
        if kept != text and not (name == PROTOCOL and without_values(kept) == without_values(text)):
            path.write_text(text, encoding="utf-8")
    if not GALLERY_CASES.exists():
        GALLERY_CASES.write_text("`make docs` computes the cases; they are not here.\n", encoding="utf-8")


if __name__ == "__main__":
    main()
