"""A model file for each recording, red where it is worse, and no celebration of what the rows do not support."""

from __future__ import annotations

import shutil

import pytest

from tests.support.live_page import until
from tests.support.measured import gauges, hidden, record
from tests.support.workbench_page import SHOWN, page_without_machine, workbench_tabs

GREEN = "rgb(0, 158, 115)"
# Of each effect it is known whether the rows support it.
ANSWERED = "bench.warnings.size >= document.querySelectorAll('.effect .share').length"


@pytest.fixture(scope="module")
def directory(tmp_path_factory):
    directory = tmp_path_factory.mktemp("truthful")
    recordings = directory / "recordings"
    recordings.mkdir()
    record(recordings, gauges(200, 1), [hidden("link_expansion", 5.0)], name="warm")
    record(recordings, gauges(200, 2), [hidden("link_expansion", -5.0)], name="cold")
    return directory


@pytest.fixture
def tabs(chromium, directory):
    with page_without_machine(directory) as (address, _), workbench_tabs(chromium, address) as opened:
        yield opened


def add(tab, effect):
    tab.locator(f"[data-effect={effect}]").click()
    until(tab, "document.getElementById('add')")
    tab.locator("#add").click()
    until(tab, "document.getElementById('confirm')")
    tab.locator("#confirm").click()
    until(tab, f"{SHOWN} && bench.summary.ledger.length > 0")


def test_each_recording_has_a_model_file_of_its_own_unless_another_is_named(tabs):
    tab = tabs("x.model.yaml", "warm")
    tab.goto(tab.url.partition("?")[0] + "?recording=warm")
    until(tab, SHOWN)
    assert tab.locator("#model").input_value() == "warm.model.yaml"
    tab.locator("#recording").select_option("cold")
    assert tab.locator("#model").input_value() == "cold.model.yaml"
    tab.locator("#model").fill("both.model.yaml")
    tab.locator("#recording").select_option("warm")
    assert tab.locator("#model").input_value() == "both.model.yaml"


def test_what_the_rows_support_is_green_and_large_and_on_another_recording_red(tabs, directory):
    tab = tabs("warm.model.yaml", "warm")
    until(tab, ANSWERED)
    colour = "getComputedStyle(document.querySelector('[data-effect={}] .share i')).backgroundColor"
    until(tab, f"{colour.format('link_expansion')} === '{GREEN}'")
    doubted = tab.evaluate("[...bench.warnings].filter(([, warning]) => warning).map(([effect]) => effect)")
    shown = tab.evaluate("[...document.querySelectorAll('.effect .share')].map((e) => e.parentElement.dataset.effect)")
    assert set(doubted) & set(shown)
    for effect in set(doubted) & set(shown):
        assert tab.evaluate(colour.format(effect)) != GREEN
    add(tab, "link_expansion")
    assert tab.locator(".fall.doubted, .fall.worse").count() == 0
    size = "parseFloat(getComputedStyle(document.querySelector('.fall b')).fontSize)"
    large = tab.evaluate(size)
    shutil.copy(directory / "warm.model.yaml", directory / "of-warm.model.yaml")
    other = tabs("of-warm.model.yaml", "cold")
    until(other, "document.querySelector('.fall.worse')")
    assert "it makes the error larger" in other.locator(".fall").inner_text()
    assert other.evaluate(size) < large
    assert other.evaluate("getComputedStyle(document.querySelector('.fall b')).color") == "rgb(179, 71, 0)"
    assert other.locator(".falling.worse").count() == 1
    other.locator("#fit-all").click()
    until(other, "document.getElementById('confirm')")
    other.locator("#confirm").click()
    until(other, "document.querySelector('.fall.doubted') && !document.querySelector('.fall.worse')")
    assert "outside its plausible range" in other.locator(".fall").inner_text()
    assert other.evaluate(size) < large


def test_what_is_tried_without_support_is_not_large(tabs):
    tab = tabs("tried.model.yaml", "warm")
    until(tab, "[...bench.warnings].some(([, warning]) => warning)")
    effect = tab.evaluate("[...bench.warnings].find(([, warning]) => warning)[0]")
    tab.locator(f"[data-effect={effect}]").click()
    until(tab, "document.getElementById('fit')")
    tab.locator("#fit").click()
    until(tab, "document.querySelector('.fall.doubted')")
    assert "not shown to be supported" in tab.locator(".fall").inner_text()
    tab.locator("[data-effect=link_expansion]").click()
    until(tab, "document.getElementById('fit') && bench.trial")
    tab.locator("#fit").click()
    until(tab, "document.querySelector('.fall') && !document.querySelector('.fall.doubted')")
