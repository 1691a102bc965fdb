"""The pages that `make docs` has built: they load nothing from elsewhere, and their links lead somewhere."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from tests.support.paths import ROOT

SITE = ROOT / "docs" / "_build" / "html"
pytestmark = pytest.mark.skipif(not (SITE / "index.html").exists(), reason="`make docs` has not been run")

ELSEWHERE = re.compile(r"^(https?:)?//")
# What a browser loads by itself when it shows a page, by element; links that a reader clicks are not among it.
LOADED = {
    "script": "src",
    "img": "src",
    "source": "src",
    "iframe": "src",
    "embed": "src",
    "video": "src",
    "object": "data",
    "link": "href",
    "use": "href",
}


class References(HTMLParser):
    """Addresses that a page loads, and addresses that it links to."""

    def __init__(self, page: Path) -> None:
        super().__init__()
        self.loaded: list[str] = []
        self.linked: list[str] = []
        self.feed(page.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        for name, value in attributes:
            if value and LOADED.get(tag) == name:
                self.loaded.append(value)
            if value and tag == "a" and name == "href":
                self.linked.append(value)


@pytest.fixture(scope="module")
def references() -> dict[Path, References]:
    return {page: References(page) for page in SITE.rglob("*.html")}


def test_no_page_loads_anything_from_elsewhere(references: dict[Path, References]) -> None:
    assert sum(len(page.loaded) for page in references.values()) > len(references)
    loaded = {(page.name, address) for page, found in references.items() for address in found.loaded}
    assert not {(page, address) for page, address in loaded if ELSEWHERE.match(address)}


def test_no_stylesheet_loads_anything_from_elsewhere() -> None:
    sheets = {path: path.read_text(encoding="utf-8") for path in SITE.rglob("*.css")}
    sheets |= {
        page: "\n".join(re.findall(r"<style>(.*?)</style>", page.read_text(encoding="utf-8"), re.DOTALL))
        for page in SITE.rglob("*.html")
    }
    assert any("compd.css" in path.name for path in sheets)
    for path, text in sheets.items():
        assert not re.search(r"(url\(|@import)\s*['\"]?(https?:)?//", text), path


def test_every_link_within_the_site_leads_to_a_file(references: dict[Path, References]) -> None:
    broken = []
    for page, found in references.items():
        for address in (*found.loaded, *found.linked):
            parts = urlsplit(address)
            if parts.scheme or parts.netloc or not parts.path:
                continue
            if not (page.parent / unquote(parts.path)).is_file():
                broken.append(f"{page.relative_to(SITE)}: {address}")
    assert not broken
