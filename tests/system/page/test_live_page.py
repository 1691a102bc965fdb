"""The machine live in a real browser."""

from __future__ import annotations

import re
import zipfile

import pytest

from tests.support.live_page import opened, until

pytestmark = pytest.mark.timeout(180)


def text(tab, selector):
    return tab.locator(selector).inner_text()


def test_the_banner_has_state_tip_and_who_looks(tab, live):
    until(tab, "document.getElementById('state').textContent === 'OK'")
    assert text(tab, "#machine-name") == "tripod-cmm"
    until(tab, r"/^x .\d.* mm$/.test(document.getElementById('tip').textContent)")
    assert "oldest gauge" in text(tab, "#age")
    until(tab, "document.getElementById('connected').textContent.includes('looking')")


def test_every_part_shows_numbers(tab):
    until(tab, "document.querySelectorAll('#timing dd').length > 5")
    assert tab.locator(".strip").count() == 3
    assert tab.locator(".axis").count() == 3
    assert re.match(r"\d+ good, oldest \d+ ms", text(tab, "#gauges-summary"))
    tab.locator("#gauge-table button").click()
    assert tab.locator("#gauge-table tbody tr").count() > 20
    painted = tab.evaluate(
        "(() => { const c = document.getElementById('scene');"
        " return c.getContext('2d').getImageData(0, 0, c.width, c.height).data.some((v) => v > 0); })()"
    )
    assert painted


def test_dragging_and_keys_turn_the_machine(tab):
    until(tab, "compd.live.scene && !compd.unpainted")
    before = tab.evaluate("document.getElementById('scene').toDataURL()")
    box = tab.locator("#scene").bounding_box()
    tab.mouse.move(box["x"] + 200, box["y"] + 200)
    tab.mouse.down()
    tab.mouse.move(box["x"] + 320, box["y"] + 220)
    tab.mouse.up()
    dragged = tab.evaluate("document.getElementById('scene').toDataURL()")
    tab.keyboard.press("t")
    assert len({before, dragged, tab.evaluate("document.getElementById('scene').toDataURL()")}) == 3


def test_space_freezes_all_but_the_banner(tab):
    until(tab, "document.querySelector('#hour-chart canvas')")
    tab.keyboard.press(" ")
    assert tab.locator("#frozen").is_visible()
    number = text(tab, ".strip .number b >> nth=0")
    tab.wait_for_timeout(500)
    assert text(tab, ".strip .number b >> nth=0") == number
    tab.keyboard.press(" ")
    assert not tab.locator("#frozen").is_visible()


def test_everybody_sees_who_is_armed(tab, chromium, live):
    with opened(chromium, live) as other:
        tab.keyboard.press("o")
        tab.locator("#arm").click()
        until(other, "document.getElementById('connected').textContent.includes('armed')")
        assert "2 looking" in text(other, "#connected")


def test_a_recording_is_made_and_downloaded(tab, live):
    tab.keyboard.press("o")
    tab.locator("input[aria-label='Name of the recording']").fill("from-the-page")
    tab.locator("#record").click()
    until(tab, "document.getElementById('record').textContent.startsWith('Stop')")
    part = live.recordings / "from-the-page-0001.csv"
    while not (part.exists() and part.stat().st_size > 1000):
        tab.wait_for_timeout(100)
    tab.locator("#record").click()
    tab.wait_for_selector("#drawer td a")
    with tab.expect_download() as download:
        tab.locator("#drawer td a").first.click()
    assert download.value.suggested_filename == "from-the-page-0001.zip"
    with zipfile.ZipFile(download.value.path()) as archive:
        assert {"from-the-page-0001.csv", "from-the-page-0001.yaml"} <= set(archive.namelist())


def test_a_lost_gauge_is_on_top_and_the_state_says_so(tab, live):
    live.machine.ask("FAULT", line="frame_u", fault="unplugged")
    try:
        until(tab, "document.body.dataset.state === 'hold'")
        until(tab, "document.querySelector('#gauge-table tr.bad')")
        assert "frame u1" in text(tab, "#reason")
        assert "frame" in text(tab, "#gauge-table tbody tr >> nth=0")
    finally:
        live.machine.ask("FAULT", line="frame_u", fault=None)


def test_events_that_the_system_kept_while_the_page_stood_still_are_never_shown_as_live(chromium, live):
    """The page is stopped for six seconds: what comes then is old, and grey until it is not."""
    with opened(chromium, live) as tab:
        seen = tab.evaluate(
            """async () => {
              const { Age } = await import('/static/age.js');
              const stood_s = 6, started = performance.now();
              const records = [];
              const source = new EventSource('live');
              const age = new Age();
              source.addEventListener('hello', () => age.begin());
              source.addEventListener('live', (event) => {
                const told = JSON.parse(event.data);
                records.push([performance.now() / 1000, told.made, age.arrived(told.made), age.behind_s]);
              });
              await new Promise((resolve) => setTimeout(resolve, 1500));
              const until = performance.now() + 1000 * stood_s;
              while (performance.now() < until);
              await new Promise((resolve) => setTimeout(resolve, 2500));
              source.close();
              return records;
            }"""
        )
        quickest = min(arrived - made for arrived, made, _, _ in seen)
        late = [(arrived - made - quickest, behind) for arrived, made, _, behind in seen]
        assert any(true > 1.0 for true, _ in late), "the page did stand still"
        assert all(behind > 0 for true, behind in late if true > 0.6)
        assert late[-1][1] == 0, "and it comes back"
