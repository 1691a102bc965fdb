"""Every gauge and line that a how-to page shows as YAML is one that its driver takes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from compd.documents import parse_yaml
from compd.plugins import GAUGES, load
from tests.support.pages import fences
from tests.support.paths import ROOT
from tests.support.wire_rig import SETTINGS

PAGES = sorted((ROOT / "docs" / "how-to").glob("*.md"))


def entries(section: str) -> Iterator[Any]:
    """Each entry of a section, of every YAML fence that has it."""
    for page in PAGES:
        for kind, content in fences(page.read_text(encoding="utf-8")):
            data = parse_yaml(content, page)[0] if kind == "yaml" else None
            named = data.get(section) if isinstance(data, dict) else None
            for name, entry in (named or {}).items():
                yield pytest.param(entry, id=f"{page.stem}: {name}")


@pytest.mark.parametrize("entry", list(entries("gauges")))
def test_a_gauge_on_a_page(entry: dict[str, Any]) -> None:
    driver = load(GAUGES, entry["driver"], entry["driver"])
    made = driver(driver.Options.model_validate(entry))
    assert made.channels
    assert not list(made.doubts())


@pytest.mark.parametrize("entry", list(entries("lines")))
def test_a_line_on_a_page(entry: dict[str, Any]) -> None:
    SETTINGS.validate_python(entry)
