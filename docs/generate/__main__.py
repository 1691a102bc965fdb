"""Write the generated pages: `python -m docs.generate`."""

from __future__ import annotations

import importlib
import pkgutil
from pathlib import Path

import docs.generate

REFERENCE = Path(__file__).parent.parent / "reference"
# Written by `python -m docs.gallery`, which takes a minute.
GALLERY_CASES = Path(__file__).parent.parent / "gallery" / "cases.md"


def page_names() -> list[str]:
    """The modules that are pages, sorted: those with a function `page`; the others hold what pages share."""
    modules = sorted(module.name for module in pkgutil.iter_modules(docs.generate.__path__))
    return [name for name in modules if hasattr(importlib.import_module(f"docs.generate.{name}"), "page")]


def page_of(name: str) -> str:
    """The text of one page, by the name of its module."""
    text: str = importlib.import_module(f"docs.generate.{name}").page()
    return text


def main() -> None:
    """Write every page that has changed, so that Sphinx builds no more than it must."""
    for name in page_names():
        text = page_of(name)
        path = REFERENCE / f"{name.replace('_', '-')}.md"
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
    if not GALLERY_CASES.exists():
        GALLERY_CASES.write_text("`make docs` computes the cases; they are not here.\n", encoding="utf-8")


if __name__ == "__main__":
    main()
