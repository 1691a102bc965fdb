"""What an operator reads and presses: the remedy, the steps of time by buttons, the tape, the wall and the phone."""

from __future__ import annotations

from dataclasses import replace

import pytest

from compd.setpoint_states import State
from tests.support.live_page import opened, until
from tests.support.scripted_page import COLUMNS, scripted

SIZES = [(1366, 768), (1920, 1080), (768, 1024), (390, 844), (3840, 2160)]
WAITS = "waits for a person: scale 1 (scale_1.position): distrusted (came back 16 mm away)"
# As long as a daemon tells it: 300 bytes.
LONG = "hold ended after 5 s; " + ", ".join(f"frame u{k} (frame_u.u{k}): line_lost (no port)" for k in range(1, 7))
INSIDE = "document.documentElement.scrollWidth <= window.innerWidth"
# Texts of the banner that are cut off.
CUT = """[...document.querySelectorAll('#banner *')].filter((part) => part.textContent.trim()
  && (part.scrollWidth > part.clientWidth + 1 || part.scrollHeight > part.clientHeight + 1)
  && getComputedStyle(part).overflow !== 'visible').map((part) => part.id || part.className)"""


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    with scripted(tmp_path_factory.mktemp("recordings")) as started:
        yield started


@pytest.fixture
def tab(chromium, page):
    page.link.tell(State.OK, "")
    with opened(chromium, page, viewport={"width": 1366, "height": 768}) as opened_tab:
        yield opened_tab


def distrust(link, channel="scale_1.position"):
    """The daemon waits for a person to accept this gauge."""
    link.tell(State.FAULT, WAITS)
    link.readings["readings"][channel] = {"quality": "distrusted", "detail": "came back 16 mm away"}


def lose(link, reason):
    """Every gauge has lost its line."""
    link.tell(State.STOP, reason)
    for column in COLUMNS:
        link.readings["readings"][column["channel"]] = {"quality": "line_lost", "detail": "no port"}


def shown(tab, text):
    until(tab, f"document.getElementById('state').textContent === '{text}'")


def test_a_remedy_that_an_order_is_has_its_button(tab, page):
    distrust(page.link)
    shown(tab, "FAULT")
    assert "reference it" in tab.locator("#remedy").inner_text()
    tab.get_by_role("banner").get_by_role("button", name="Accept gauges …").click()
    until(tab, "!document.getElementById('drawer').hidden")
    tab.wait_for_selector(".consequence")
    assert "compd accept scale_1" in tab.locator(".consequence").inner_text()
    page.link.tell(State.NO_ZERO, "no machine zero")
    shown(tab, "NO ZERO")
    assert tab.get_by_role("banner").get_by_role("button", name="Take machine zero …").is_visible()


def test_who_may_only_look_reads_the_remedy_and_who_can_do_it(chromium, page):
    """No button of an order that would be refused, neither on top nor in the gauge's row."""
    distrust(page.link)
    viewer = replace(page, address=page.viewer)
    with opened(chromium, viewer, viewport={"width": 1366, "height": 768}) as tab:
        shown(tab, "FAULT")
        until(tab, "document.querySelector('#gauge-table tr.bad')")
        until(tab, "document.getElementById('remedy').textContent.includes('role operate')")
        assert "Accept gauges …" in tab.locator("#remedy").inner_text()
        assert tab.get_by_role("button", name="Accept").filter(visible=True).count() == 0
    page.link.tell(State.OK, "")


def test_a_remedy_of_hands_has_none_and_names_the_gauge(tab, page):
    lose(page.link, "scale 1 to 3: line_lost (no port)")
    shown(tab, "STOP")
    assert "scale_1 and 2 more: check plug, cable and power" in tab.locator("#remedy").inner_text()
    assert not tab.locator("#remedy-order").is_visible()
    page.link.tell(State.OK, "")
    shown(tab, "OK")
    assert tab.locator("#remedy").inner_text() == ""


def test_orders_are_opened_by_a_button_of_that_name(tab):
    tab.get_by_role("button", name="Orders").click()
    tab.get_by_role("heading", name="Orders").wait_for()


def test_every_key_has_a_button(tab):
    """Freeze, steps both ways, views, zoom and the list itself; other keys select a link, or close what is open."""
    until(tab, "document.querySelector('#hour-chart canvas')")
    tab.get_by_role("button", name="Freeze").click()
    assert tab.get_by_text("Frozen at").is_visible()
    for name in ("◂ 1 min", "◂ 1 s", "◂ 0.1 s", "0.1 s ▸", "1 s ▸", "1 min ▸", "Zoom in", "Zoom out", "Hour"):
        tab.get_by_role("button", name=name, exact=True).click()
    views = set()
    for name in ("Front", "Side", "Top"):
        tab.get_by_role("button", name=name, exact=True).click()
        views.add(tab.evaluate("(({turn, tilt}) => `${turn} ${tilt}`)(compd.parts.machine.turn)"))
    assert len(views) == 3
    tab.get_by_role("button", name="Go on").click()
    assert not tab.get_by_text("Frozen at").is_visible()
    tab.get_by_role("button", name="Keys").click()
    buttons = tab.evaluate("[...document.querySelectorAll('[data-key]')].map((one) => one.dataset.key)")
    assert {" ", "ArrowLeft", "ArrowRight", ",", ".", "f", "s", "t", "+", "-", "0", "?"} <= set(buttons)


def test_the_tape_stands_still_when_gauges_are_shown(tab, page):
    place = "JSON.stringify(document.getElementById('tape').getBoundingClientRect())"
    chart = "document.getElementById('hour-chart').getBoundingClientRect().top + scrollY"
    before = tab.evaluate(f"[{place}, {chart}]")
    lose(page.link, LONG)
    shown(tab, "STOP")
    until(tab, "document.querySelectorAll('#gauge-table tbody tr').length === 3")
    assert tab.evaluate(f"[{place}, {chart}]") == before
    tab.get_by_role("button", name="Freeze").click()
    assert tab.evaluate(f"[{place}, {chart}]") == before


def test_the_tape_scrubs_by_dragging_and_zooms_by_wheel(tab):
    until(tab, "compd.parts.hour.times.length > 2")
    box = tab.locator("#tape").bounding_box()
    y = box["y"] + box["height"] / 2
    tab.mouse.move(box["x"] + box["width"] - 1, y)
    tab.mouse.wheel(0, -4000)
    until(tab, "compd.parts.hour.window.span_s === 20")
    tab.mouse.down()
    tab.mouse.move(box["x"] + box["width"] - 60, y, steps=4)
    tab.mouse.up()
    assert tab.get_by_text("Frozen at").is_visible()
    at_s, left_s, right_s = tab.evaluate("(({at_s, window}) => [at_s, window.left, window.right])(compd.parts.hour)")
    assert left_s <= at_s < right_s
    tab.get_by_role("button", name="Hour").click()
    assert tab.evaluate("compd.parts.hour.window.span_s") == 3600


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_the_wall_is_read_from_three_metres(tab, page, width, height):
    lose(page.link, LONG)
    tab.set_viewport_size({"width": width, "height": height})
    tab.goto(page.address.partition("?")[0] + "wall")
    shown(tab, "STOP")
    assert tab.evaluate("parseFloat(getComputedStyle(document.getElementById('state')).fontSize)") >= 70
    assert tab.evaluate("document.getElementById('sign').textContent") == "■", "no colour alone"
    assert tab.get_by_text("Reason").is_visible()
    assert "check plug" in tab.locator("#remedy").inner_text()
    assert tab.evaluate(INSIDE)
    assert tab.evaluate("document.getElementById('remedy').getBoundingClientRect().bottom <= window.innerHeight")
    page.link.tell(State.OK, "")
    shown(tab, "OK")
    assert "12.3456" in tab.locator("#tip").inner_text()
    page.link.gone("it closed the connection")
    shown(tab, "NO DAEMON")
    assert tab.locator("#tip").inner_text() == "", "no number of what was"
    assert "compd run" in tab.locator("#remedy").inner_text()
    page.link.tell(State.OK, "")


def test_a_phone_shows_reason_remedy_and_orders_first_and_cuts_nothing(chromium, page):
    page.link.tell(State.OK, "")
    with opened(chromium, page, viewport={"width": 390, "height": 844}, has_touch=True) as tab:
        shown(tab, "OK")
        tape = tab.locator("#tape").bounding_box()
        lose(page.link, LONG)
        shown(tab, "STOP")
        assert tab.locator("#tape").bounding_box() == tape
        until(tab, "document.querySelectorAll('#gauge-table tbody tr').length === 3")
        assert tab.evaluate(INSIDE)
        assert tab.evaluate(CUT) == []
        order = ["reason", "remedy", "role", "gauges", "machine"]
        top = {part: tab.locator(f"#{part}").bounding_box()["y"] for part in order}
        assert sorted(order, key=top.get) == order
        assert top["role"] < 400
        assert tab.locator("#gauge-table td.quality").first.bounding_box()["x"] < 60
        until(tab, "compd.parts.hour.times.length > 2")
        tab.locator("#tape").tap(position={"x": 300, "y": 10})
        assert tab.get_by_text("Frozen at").is_visible()
    page.link.tell(State.OK, "")
