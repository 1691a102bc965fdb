"""The list of decisions has every decision: in the table, under its own title, and in the table of contents."""

from __future__ import annotations

import re

import pytest

from tests.support.paths import ROOT

DECISIONS = ROOT / "docs" / "decisions"
PAGES = sorted(DECISIONS.glob("[0-9]*.md"))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_index_lists_a_decision(page):
    number = int(page.stem[:4])
    index = (DECISIONS / "index.md").read_text(encoding="utf-8")
    row = re.search(rf"^\| {number} \| \[(.+)\]\({page.name}\) \| (.+) \|$", index, re.MULTILINE)
    assert row, f"docs/decisions/index.md has no row of {page.name}"
    assert f"\n{page.stem}\n" in index.partition("{toctree}")[2]
    assert page.read_text(encoding="utf-8").startswith(f"# {number}. ")


def test_the_decisions_are_numbered_without_a_gap():
    assert [int(page.stem[:4]) for page in PAGES] == list(range(1, len(PAGES) + 1))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_decision_has_its_headings(page):
    headings = re.findall(r"^## (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    assert headings[:2] == ["Context", "Decision"]
    assert "Consequences" in headings
