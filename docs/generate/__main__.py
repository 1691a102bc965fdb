"""Write the generated pages: `python -m docs.generate`."""

from __future__ import annotations

import importlib
import pkgutil
from pathlib import Path

import docs.generate

REFERENCE = Path(__file__).parent.parent / "reference"
# Written by `python -m docs.gallery`, which takes a minute.
GALLERY_CASES = Path(__file__).parent.parent / "gallery" / "cases.md"


def pages() -> dict[str, str]:
    """The text of every generated page, by file name."""
    names = [module.name for module in pkgutil.iter_modules(docs.generate.__path__) if module.name != "__main__"]
    return {
        f"{name.replace('_', '-')}.md": importlib.import_module(f"docs.generate.{name}").page()
        for name in sorted(names)
    }


def main() -> None:
    """Write every page that has changed, so that Sphinx builds no more than it must."""
    for name, text in pages().items():
        path = REFERENCE / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
    if not GALLERY_CASES.exists():
        GALLERY_CASES.write_text("`make docs` computes the cases; they are not here.\n", encoding="utf-8")


if __name__ == "__main__":
    main()
