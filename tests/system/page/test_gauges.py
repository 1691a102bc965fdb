"""The table of gauges: its last minute, its counts of faults, and what a click marks."""

from __future__ import annotations

import re

import pytest

from tests.support.live_page import opened, until

pytestmark = pytest.mark.long

PAINTED = """[...document.querySelectorAll('.spark')].filter((canvas) =>
  canvas.width && canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data.some((v) => v)).length"""


def test_each_gauge_has_its_last_minute_and_its_faults_in_all_and_since_when(tab):
    tab.locator("#gauge-table button").click()
    until(tab, "document.querySelectorAll('.spark').length > 20")
    until(tab, f"{PAINTED} > 20")
    head = tab.locator("#gauge-table thead").inner_text()
    assert re.search(r"since \d\d:\d\d|in the last hour", head)
    until(tab, "/^\\d+$/.test(document.querySelector('#gauge-table tbody tr').lastChild.textContent)")
    assert re.search(r"\d+\.\d µm", tab.locator("#gauge-table tbody tr").first.inner_text())


def test_the_minute_before_is_there_when_the_page_opens(tab, chromium, live):
    until(tab, "compd.live.unix_s")
    since_s = tab.evaluate("compd.live.unix_s")
    until(tab, f"compd.live.unix_s > {since_s} + 6")
    opened_s = tab.evaluate("compd.live.unix_s")
    with opened(chromium, live) as other:
        times = "compd.parts.gauges.traces.times"
        until(other, f"{times}.length > 0")
        # what the page has drawn itself since it was opened is later
        assert other.evaluate(f"{times}[0]") < opened_s - 5
        assert other.evaluate(f"{times}.every((time, k) => !k || time > {times}[k - 1])")


def test_the_faults_of_a_gauge_are_counted_and_its_accept_button_stays_while_numbers_change(tab, live):
    tab.locator("#gauge-table button").click()
    live.machine.ask("FAULT", line="frame_u", fault="unplugged")
    row = "[...document.querySelectorAll('#gauge-table tr')].find((row) => row.textContent.includes('frame_u.u1'))"
    try:
        recent = f"Number({row}?.lastChild.textContent)"
        until(tab, f"{recent} > 0")
        tab.evaluate(f"compd.row = {row}; null")
        seen = tab.evaluate(recent)
        until(tab, f"{recent} > {seen}")
        assert tab.evaluate("compd.row.isConnected"), "what a person is about to press is not made anew"
    finally:
        live.machine.ask("FAULT", line="frame_u", fault=None)


def test_a_click_marks_the_link_that_a_gauge_measures(tab):
    tab.locator("#gauge-table button").click()
    tab.locator("#gauge-table tbody tr", has_text="scale 2").click()
    assert tab.locator(".strip.selected").get_attribute("title") == "link 2"
