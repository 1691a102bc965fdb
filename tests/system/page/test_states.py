"""Every state has its own word, sign and colour in the banner, in legible text; without a daemon no number is left."""

from __future__ import annotations

import pytest

from compd.setpoint_states import State
from tests.support.live_page import opened, until
from tests.support.sampled import sampled
from tests.support.scripted_page import scripted

# By the tone of a state: the ground of the banner. Hold and fade are hatched as well.
GROUNDS = {"good": "rgb(0, 113, 79)", "care": "rgb(138, 90, 0)", "bad": "rgb(169, 68, 0)", "gone": "rgb(87, 96, 106)"}
TONES = {
    State.STARTING: "care",
    State.NO_ZERO: "bad",
    State.OK: "good",
    State.SLEWING: "care",
    State.CLAMPED: "care",
    State.HOLD: "care",
    State.FADE: "care",
    State.STOP: "bad",
    State.REFUSED: "bad",
    State.DEGRADED: "care",
    State.FAULT: "bad",
}
SIZES = {"monitor": {"width": 1366, "height": 768}, "tablet": {"width": 768, "height": 1024}}
# As long as the daemon's own: it names gauges.
REASON = "scale_1.position timeout (no byte came), frame_u.u1 line_lost (the port is gone); the last good set is used"
MIN_CONTRAST = 4.5

# Text of the banner with the ratio of contrast to its ground (WCAG 2.2, 1.4.3): to the darkest and the lightest of a
# hatched one.
CONTRASTS = """() => {
  const numbers = (colour) => colour.match(/[\\d.]+/g).map(Number);
  const over = ([r, g, b, a = 1], ground) => [r, g, b].map((value, k) => a * value + (1 - a) * ground[k]);
  const channel = (value) => (value /= 255) <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4;
  const luminance = (rgb) => rgb.map(channel).reduce((sum, value, k) => sum + value * [0.2126, 0.7152, 0.0722][k], 0);
  const ratio = (a, b) => {
    const [low, high] = [luminance(a), luminance(b)].sort((x, y) => x - y);
    return (high + 0.05) / (low + 0.05);
  };
  const banner = document.getElementById('banner'), style = getComputedStyle(banner);
  const plain = numbers(style.backgroundColor).slice(0, 3);
  const hatching = style.backgroundImage.match(/rgba?\\([^)]*\\)/g) ?? [];
  const stripes = hatching.map((colour) => over(numbers(colour), plain));
  const contrasts = {};
  for (const part of banner.querySelectorAll('*')) {
    const own = [...part.childNodes].some((node) => node.nodeType === 3 && node.data.trim());
    if (!own || !part.getClientRects().length) continue;
    const above = numbers(getComputedStyle(part).backgroundColor);
    const grounds = [plain, ...stripes].map((ground) => over(above, ground));
    const ink = numbers(getComputedStyle(part).color).slice(0, 3);
    contrasts[part.id || part.tagName] = Math.min(...grounds.map((ground) => ratio(ink, ground)));
  }
  return contrasts;
}"""
# What is wider than its place, or reaches over the banner's or the window's edge.
CUT_OFF = """() => {
  const banner = document.getElementById('banner'), edge = banner.getBoundingClientRect();
  return [banner, ...banner.querySelectorAll('*')].filter((part) => {
    const box = part.getBoundingClientRect();
    return box.width && (part.scrollWidth > part.clientWidth && getComputedStyle(part).display !== 'inline'
      || part.scrollHeight > part.clientHeight + 1 && getComputedStyle(part).overflow !== 'visible'
      || box.left < 0 || box.right > window.innerWidth || box.bottom > edge.bottom + 1);
  }).map((part) => part.id || part.className || part.tagName);
}"""


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    with scripted(tmp_path_factory.mktemp("recordings")) as started:
        yield started


@pytest.fixture(scope="module", params=sampled(["light", "dark"], 2))
def tab(chromium, page, request):
    page.link.tell(State.OK, "")
    with opened(chromium, page, color_scheme=request.param, viewport=SIZES["monitor"]) as opened_tab:
        yield opened_tab


def until_shown(tab, state):
    until(tab, f"document.body.dataset.state === '{state}'")


def shown(tab, id):
    return tab.locator(f"#{id}").inner_text()


def test_every_state_is_in_the_table():
    assert set(TONES) == set(State)


@pytest.mark.parametrize("state", State, ids=str)
def test_a_state_has_its_word_its_reason_and_its_colour(tab, page, state):
    page.link.tell(state, REASON)
    until_shown(tab, state)
    assert shown(tab, "state") == state.upper().replace("_", " ")
    assert shown(tab, "reason") == REASON
    assert tab.evaluate("getComputedStyle(document.getElementById('banner')).backgroundColor") == GROUNDS[TONES[state]]
    hatched = "gradient" in tab.evaluate("getComputedStyle(document.getElementById('banner')).backgroundImage")
    assert hatched == (state in (State.HOLD, State.FADE))
    assert bool(shown(tab, "tip")) == state.valid
    contrasts = tab.evaluate(CONTRASTS)
    assert {"state", "sign", "reason", "role"} <= set(contrasts)
    assert min(contrasts.values()) >= MIN_CONTRAST, contrasts


def test_every_sign_is_one_of_its_own(tab, page):
    signs = {}
    for state in State:
        page.link.tell(state, "")
        until_shown(tab, state)
        signs[state] = shown(tab, "sign")
    page.link.gone("it closed the connection")
    until_shown(tab, "gone")
    signs["gone"] = shown(tab, "sign")
    assert len(set(signs.values())) == len(signs), signs
    assert all(len(sign) == 1 for sign in signs.values())


def test_a_state_of_another_release_is_not_valid(tab, page):
    page.link.tell(State.OK, "")
    page.link.readings["setpoint"]["state"] = "levitating"
    until_shown(tab, "levitating")
    assert shown(tab, "state") == "LEVITATING"
    assert tab.evaluate("getComputedStyle(document.getElementById('banner')).backgroundColor") == GROUNDS["bad"]


def test_without_a_daemon_no_number_of_before_is_left(tab, page):
    page.link.tell(State.OK, "")
    until(tab, "document.getElementById('tip').textContent.includes('12.3456')")
    page.link.gone("it closed the connection")
    until_shown(tab, "gone")
    assert shown(tab, "state") == "NO DAEMON"
    assert shown(tab, "reason") == "it closed the connection"
    for part in ("tip", "age", "mode"):
        assert shown(tab, part) == "", part
    banner = tab.locator("#banner").inner_text()
    assert "12.3456" not in banner
    assert "OK" not in banner
    style = tab.evaluate(
        "(({backgroundColor, backgroundImage}) => [backgroundColor, backgroundImage])"
        "(getComputedStyle(document.getElementById('banner')))"
    )
    assert style[0] == GROUNDS["gone"]
    assert "gradient" in style[1]
    contrasts = tab.evaluate(CONTRASTS)
    assert min(contrasts.values()) >= MIN_CONTRAST, contrasts


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("state", [State.OK, State.DEGRADED, State.STOP], ids=str)
def test_nothing_of_the_banner_is_cut_off(tab, page, state, size):
    tab.set_viewport_size(SIZES[size])
    page.link.tell(state, "" if state is State.OK else REASON)
    until_shown(tab, state)
    until(tab, "document.getElementById('connected').textContent")
    assert tab.evaluate(CUT_OFF) == []
