"""The machine live in a real browser."""

from __future__ import annotations

import re
import zipfile

import pytest

from tests.support.live_page import opened, until


def text(tab, selector):
    return tab.locator(selector).inner_text()


def test_the_banner_has_state_tip_and_who_looks(tab, live):
    until(tab, "document.getElementById('state').textContent === 'OK'")
    assert text(tab, "#machine-name") == "tripod-cmm"
    until(tab, r"/^x .\d.* mm, within [\d.]+ µm$/.test(document.getElementById('tip').textContent)")
    assert "oldest gauge" in text(tab, "#age")
    until(tab, "document.getElementById('connected').textContent.includes('looking')")


def test_every_part_shows_numbers(tab):
    until(tab, "document.querySelectorAll('#timing dd').length > 5")
    assert tab.locator(".strip").count() == 3
    assert tab.locator(".axis").count() == 3
    # a gauge may be late for a moment where other tests take the processor
    until(tab, r"/^\d+ good, oldest \d+ ms/.test(document.getElementById('gauges-summary').innerText)")
    tab.locator("#gauge-table button").click()
    assert tab.locator("#gauge-table tbody tr").count() > 20
    painted = tab.evaluate(
        "(() => { const c = document.getElementById('scene');"
        " return c.getContext('2d').getImageData(0, 0, c.width, c.height).data.some((v) => v > 0); })()"
    )
    assert painted


@pytest.mark.long
def test_dragging_and_keys_turn_the_machine(tab):
    until(tab, "compd.live.scene && !compd.unpainted")
    tab.keyboard.press(" ")  # one and the same moment
    before = tab.evaluate("document.getElementById('scene').toDataURL()")
    box = tab.locator("#scene").bounding_box()
    tab.mouse.move(box["x"] + 200, box["y"] + 200)
    tab.mouse.down()
    tab.mouse.move(box["x"] + 320, box["y"] + 220)
    tab.mouse.up()
    dragged = tab.evaluate("document.getElementById('scene').toDataURL()")
    tab.keyboard.press("t")
    assert len({before, dragged, tab.evaluate("document.getElementById('scene').toDataURL()")}) == 3


def shown(tab):
    """What the parts show, as text."""
    return tab.evaluate(
        "['strips', 'budget', 'gauge-table'].map((id) => document.getElementById(id).innerText).join()"
        " + document.getElementById('scene').toDataURL()"
    )


def test_space_freezes_all_but_the_banner(tab):
    until(tab, "document.querySelector('#hour-chart canvas')")
    tab.locator("#gauge-table button").click()
    tab.locator("#scene").focus()  # space on a button presses the button
    tab.keyboard.press(" ")
    assert tab.locator("#frozen").is_visible()
    assert re.match(r"\S [A-Z]+", text(tab, "#frozen-state"))
    before, unix_s = shown(tab), tab.evaluate("compd.live.unix_s")
    until(tab, f"compd.live.unix_s > {unix_s} + 1")
    assert shown(tab) == before
    tab.keyboard.press(" ")
    assert not tab.locator("#frozen").is_visible()
    until(tab, f"!compd.unpainted && compd.live.unix_s > {unix_s} + 2")
    assert shown(tab) != before


@pytest.mark.long
def test_scrubbing_shows_the_machine_links_tip_and_gauges_of_that_moment(tab, live):
    """A gauge of the frame is moved; then the page goes back to before that, and forth."""
    until(tab, "document.querySelector('#hour-chart canvas')")
    tab.locator("#gauge-table button").click()
    until(tab, "compd.live.setpoint.state === 'ok' && (compd.test_s = compd.live.unix_s)")
    before_s = tab.evaluate("compd.test_s")
    until(tab, f"compd.live.unix_s > {before_s} + 1.5")
    live.machine.ask("FAULT", line="frame_u", fault="unplugged")
    try:
        until(tab, "document.body.dataset.state === 'hold'")
        tab.locator("#scene").focus()
        tab.keyboard.press(" ")
        until(tab, "document.getElementById('frozen-state').textContent.includes('HOLD')")
        assert "not good" in text(tab, "#gauges-summary")
        held = shown(tab)
        tab.evaluate(f"document.dispatchEvent(new CustomEvent('freeze', {{ detail: {{ at_s: {before_s} }} }}))")
        until(tab, "document.getElementById('frozen-state').textContent.includes('OK')")
        assert shown(tab) != held
        assert re.search(r"tip x .\d", text(tab, "#frozen-state"))
        assert re.match(r"\d+ (good|of \d+ not good)", text(tab, "#gauges-summary"))
        assert tab.evaluate("document.body.dataset.state") == "hold", "the banner goes on"
        assert "not kept" in text(tab, "#loop-note")
    finally:
        live.machine.ask("FAULT", line="frame_u", fault=None)


@pytest.mark.long
def test_arrows_and_points_scrub_by_a_second_and_a_tenth(tab):
    until(tab, "document.querySelector('#hour-chart canvas') && compd.live.unix_s")
    unix_s = tab.evaluate("compd.live.unix_s")
    until(tab, f"compd.live.unix_s > {unix_s} + 4")
    tab.keyboard.press(" ")
    shown_at = "(() => { const [h, m, s] = document.getElementById('frozen-at').textContent.split(':').map(Number);"
    shown_at += " return 3600 * h + 60 * m + s; })()"
    start = tab.evaluate(shown_at)
    tab.keyboard.press("ArrowLeft")
    tab.keyboard.press("ArrowLeft")
    until(tab, f"Math.abs({start} - {shown_at} - 2) < 0.16")
    tab.keyboard.press(".")
    until(tab, f"Math.abs({start} - {shown_at} - 1.9) < 0.16")
    tab.keyboard.press("Escape")
    assert not tab.locator("#frozen").is_visible()


@pytest.mark.long
@pytest.mark.sample
def test_everybody_sees_who_is_armed(tab, chromium, live):
    with opened(chromium, live) as other:
        tab.keyboard.press("o")
        tab.locator("#arm").click()
        until(other, "document.getElementById('connected').textContent.includes('armed')")
        assert "2 looking" in text(other, "#connected")


@pytest.mark.long
@pytest.mark.sample
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
        until(tab, "document.querySelector('#gauge-table tbody tr').textContent.includes('frame')")
    finally:
        live.machine.ask("FAULT", line="frame_u", fault=None)


@pytest.mark.long
@pytest.mark.sample
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
                const message = JSON.parse(event.data);
                records.push([performance.now() / 1000, message.made, age.arrived(message.made), age.behind_s]);
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


def test_a_window_that_is_made_narrower_shows_the_strips_whole(tab):
    until(tab, "document.querySelectorAll('.strip canvas').length === 3")
    right = "getBoundingClientRect().right"
    ends = f"[...document.querySelectorAll('.strip, .strip canvas')].map((part) => part.{right})"
    for width in (1920, 1366, 390):
        tab.set_viewport_size({"width": width, "height": 844})
        until(tab, f"Math.max(...{ends}) <= document.getElementById('links').{right}")
        assert tab.evaluate("document.documentElement.scrollWidth") <= width
