"""No text that a person sees on a page writes a micrometre as "um": the page's answers and static pages typeset it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.support.built_machines import built, drawing, record
from tests.support.command import run_in_process
from tests.support.join_files import GAUGES_WITH_PLACES, POINTS, TRACK, write_join_files
from tests.support.live_page import CHROMIUM, browser, opened, page_process, served, until
from tests.support.measured import gauges, hidden
from tests.support.measured import record as measured
from tests.support.workbench_page import page_without_machine, workbench_tabs

pytestmark = pytest.mark.long

# A unit that stands alone or in a quotient; columns and options have it in their names.
PLAIN = re.compile(r"(?<![\w.-])u(?:m|rad)\b(?![.=(])")
# The visible text, folded parts too, without what is copied or as its file has it: commands, terminal, first rows.
SEEN = """() => {
  for (const part of document.querySelectorAll("details")) part.open = true;
  for (const part of document.querySelectorAll(".command, code, pre, #table")) part.remove();
  return document.body.innerText;
}"""


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    if not CHROMIUM:
        pytest.skip("Chromium is not there; on Debian: apt-get install chromium")
    with browser() as started:
        yield started


def plain_units(tab: Any) -> list[str]:
    """The lines of a page that have a unit as files write it."""
    text = tab.evaluate(SEEN)
    assert "µm" in text, text
    return [line for line in text.splitlines() if PLAIN.search(line)]


def test_the_workbench(chromium: Any, tmp_path: Path) -> None:
    (tmp_path / "recordings").mkdir()
    measured(tmp_path / "recordings", gauges(600, 1), [hidden("link_elasticity", 60.0)], name="monday-1")
    with page_without_machine(tmp_path) as (address, _), workbench_tabs(chromium, address) as tabs:
        tab = tabs("machine.model.yaml")
        tab.locator("[data-effect=link_elasticity]").click()
        until(tab, "document.getElementById('add')")
        tab.locator("#add").click()
        until(tab, "document.getElementById('confirm')")
        tab.locator("#diagnose").click()
        until(tab, "document.querySelectorAll('#diagnosis-outcome details').length > 0", 120.0)
        for k, name in enumerate(("link_elasticity", "joint_contact")):
            tab.locator(f"#plan select[aria-label^='Rivals, number {k + 1}']").select_option(name)
        tab.locator("#plan-rows").fill("12")
        tab.locator("#plan-button").click()
        until(tab, "document.querySelectorAll('#plan-table tbody tr').length > 0", 120.0)
        assert plain_units(tab) == []


@pytest.mark.parametrize(("export", "by"), [(TRACK, "time"), (POINTS, "order")])
def test_the_join_wizard(chromium: Any, tmp_path: Path, export: str, by: str) -> None:
    write_join_files(tmp_path, tmp_path / "recordings")
    with page_process(Path("/no/socket"), tmp_path / "recordings") as (address, _):
        tab = chromium.new_page()
        tab.goto(address)
        tab.goto(address.partition("?")[0] + "join")
        until(tab, "wizard.sources && document.getElementById('recording').options.length >= 2")
        tab.locator("#recording").select_option(GAUGES_WITH_PLACES)
        tab.locator("#export").select_option(export)
        until(tab, f"wizard.table && wizard.choices.export === '{export}'")
        tab.locator("#choice-by").select_option(by)
        tab.locator("#try").click()
        until(tab, "wizard.trial?.lines?.length || wizard.trial?.reason")
        shown = tab.locator("#result").inner_text()
        assert not PLAIN.search(shown), shown
        assert plain_units(tab) == []
        titles = [heading[0] for heading in tab.locator("main h2").all_inner_texts()]
        assert titles == ["1", "2", "3", "4"]
        tab.close()


def test_the_live_page(chromium: Any) -> None:
    with served() as page, opened(chromium, page) as tab:
        tab.locator("#role").click()
        assert plain_units(tab) == []


@pytest.fixture(scope="module")
def static_pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """What the commands write, by the command."""
    directory = tmp_path_factory.mktemp("static")
    machine, rng = drawing("6-ups", directory), np.random.default_rng(8)
    poses = record(directory / "poses.csv", built(machine, rng), rng, 30)
    measured(directory, gauges(600, 1), [hidden("link_elasticity", 60.0)], name="monday")
    monday = directory / "monday.csv"
    commands = {
        "compare": ("compare", monday),
        "diagnose": ("diagnose", monday),
        "calibrate": ("calibrate", poses, "--machine", machine),
        "effect": ("model", "effect", "link_elasticity"),
        "fleet": ("fleet", "report", monday, "--out", directory / "fleet.parquet"),
    }
    pages = {name: directory / f"{name}.html" for name in commands}
    for name, words in commands.items():
        run_in_process(*map(str, words), "--html", str(pages[name]))
    return pages


@pytest.mark.parametrize("name", ["compare", "diagnose", "calibrate", "effect", "fleet"])
def test_a_static_page(chromium: Any, static_pages: dict[str, Path], name: str) -> None:
    tab = chromium.new_page(viewport={"width": 1366, "height": 768})
    tab.goto(static_pages[name].as_uri())
    text = tab.evaluate(SEEN)
    assert [line for line in text.splitlines() if PLAIN.search(line)] == []
    for width in (1366, 390):
        tab.set_viewport_size({"width": width, "height": 768})
        until(tab, "document.documentElement.scrollWidth <= document.documentElement.clientWidth")
    tab.close()
