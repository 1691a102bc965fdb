"""The page: one template for all, texts escaped, nothing loaded from a network."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path

import pytest
from plotly.graph_objects import Figure

from compd.page.server import STATIC
from compd.release import __version__
from compd.report import AXIS_COLOURS, SERIES_COLOURS
from compd.report.page import SHARED_SCRIPT, PageText, Panel, write_page
from compd.report.page_table import PageTable

NASTY = '<script>alert("1 & 2")</script>'
VOID = {"meta", "br", "!doctype"}


class Outline(HTMLParser):
    """Elements that are open, texts by element, and addresses that a browser would load."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.texts: dict[str, list[str]] = {}
        self.loaded: list[str] = []
        self.numeric: list[str] = []

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        if tag not in VOID:
            self.open.append(tag)
        values = dict(attributes)
        self.loaded += [value for name, value in values.items() if name in ("src", "href") and value]
        if values.get("class") == "number":
            self.numeric.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and data.strip():
            self.texts.setdefault(self.open[-1], []).append(data)


@pytest.fixture
def outline(tmp_path: Path) -> Outline:
    table = PageTable((NASTY, "rms", "seen"), [("x", "0.31 um", "-"), ("y", "-0.2 um", "yes")], NASTY)
    panels = [Panel(NASTY, NASTY, table), Panel("Figure", "A line.", Figure().add_scatter(x=[1, 2], y=[3, 4]))]
    path = tmp_path / "page.html"
    write_page(path, NASTY, NASTY, panels, NASTY)
    outline = Outline()
    outline.feed(path.read_text(encoding="utf-8"))
    return outline


@pytest.mark.parametrize("element", ["title", "h1", "h2", "p", "caption", "th", "footer"])
def test_every_text_is_escaped(outline: Outline, element: str) -> None:
    assert NASTY in "".join(outline.texts[element])


def test_elements_are_closed_and_nothing_is_loaded(outline: Outline) -> None:
    assert outline.open == []
    assert outline.loaded == []
    assert sum("Plotly.newPlot" in script for script in outline.texts["script"]) == 1


def test_pages_of_a_directory_can_share_the_script(tmp_path: Path) -> None:
    panels = [Panel("Figure", "A line.", Figure().add_scatter(x=[1, 2], y=[3, 4]))]
    write_page(tmp_path / "page.html", "Title", "Verdict", panels, "", shared_script=True)
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    outline = Outline()
    outline.feed(text)
    assert outline.loaded == [SHARED_SCRIPT]
    assert "Plotly.newPlot" in text
    assert len(text) < 50_000 < (tmp_path / SHARED_SCRIPT).stat().st_size


def test_the_footer_ends_with_date_and_release(outline: Outline) -> None:
    (footer,) = outline.texts["footer"]
    assert re.search(rf"Written on \d{{4}}-\d\d-\d\d by compd {re.escape(__version__)}\.$", footer)


def test_a_page_without_figures_does_not_carry_the_script_that_draws_them(tmp_path: Path) -> None:
    path = tmp_path / "page.html"
    write_page(path, "Title", "Verdict", [Panel("In numbers", "", PageTable(("a",), [("1",)]))], "")
    assert path.stat().st_size < 50_000


def test_no_figure_offers_to_upload_itself(outline: Outline) -> None:
    (call,) = [script for script in outline.texts["script"] if "Plotly.newPlot" in script and "figure-1" in script]
    assert '"showSendToCloud": false' in call


def test_only_columns_of_numbers_are_aligned_on_the_right(outline: Outline) -> None:
    assert outline.numeric == ["th", "td", "td"]


def test_texts_and_figures_say_micrometres(tmp_path: Path) -> None:
    figure = Figure().add_scatter(x=[1.0, 2.0], y=[3.0, 4.0], name="x, um", hovertemplate="%{y} um<extra></extra>")
    table = PageTable(("a, um",), [("0.3 um of tip_x_um",)])
    panels = [Panel("Residual, um", "In um.", table), Panel("Figure", "", figure)]
    write_page(tmp_path / "page.html", "Title", "0.3 um", panels, "", shared_script=True)
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert not re.search(r"(?<![\w_])um\b", text.partition("<h1>")[2])
    assert "0.3 µm of tip_x_um" in text


def test_lines_to_be_copied_stay(tmp_path: Path) -> None:
    write_page(tmp_path / "page.html", "Title", "", [Panel("Formula", "", PageText("unit: um"))], "")
    assert "<pre>unit: um</pre>" in (tmp_path / "page.html").read_text(encoding="utf-8")


def test_x_y_and_z_have_the_colours_of_the_page_server() -> None:
    rules = (STATIC / "page.css").read_text(encoding="utf-8")
    for page in STATIC.glob("*.html"):
        assert 'href="/static/axes.css"' in page.read_text(encoding="utf-8"), page.name
    assert not re.search(r"--[xyz]:", rules)
    assert SERIES_COLOURS[:3] == tuple(AXIS_COLOURS[axis] for axis in "xyz")
