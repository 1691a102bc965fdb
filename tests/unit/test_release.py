"""What describes a release says the same in pyproject.toml, CITATION.cff and CHANGELOG.md."""

from __future__ import annotations

import re
import tomllib
from typing import Any

import yaml

from tests.support.paths import ROOT

PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CITATION: dict[str, Any] = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))


def test_the_citation_has_what_its_format_requires() -> None:
    """Required keys of the Citation File Format 1.2.0."""
    assert CITATION["cff-version"] == "1.2.0"
    assert CITATION["type"] == "software"
    for work in (CITATION, *CITATION["references"]):
        assert work["title"]
        assert all("name" in author or "family-names" in author for author in work["authors"])
    assert CITATION["message"]
    assert all(work["type"] for work in CITATION["references"])


def test_the_citation_is_of_this_release() -> None:
    assert (CITATION["version"], CITATION["license"]) == (PROJECT["version"], PROJECT["license"])
    assert CITATION["authors"] == PROJECT["authors"]


def test_the_changelog_has_this_release_with_its_date() -> None:
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    headings = re.findall(r"^## (.+)$", changelog, flags=re.MULTILINE)
    released = [heading for heading in headings if heading != "Unreleased"]
    assert released[0] == f"{PROJECT['version']} ({CITATION['date-released']})"


def test_the_paper_is_cited_as_in_the_readme() -> None:
    (paper,) = CITATION["references"]
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    assert f"*{paper['title']}*" in readme
