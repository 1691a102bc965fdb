"""Which browser is armed, and for how long."""

from __future__ import annotations

import pytest

from compd.page.browsers import ARMED_S, Browsers
from compd.page.guard import Token, hashed
from tests.support.hand_clock import HandClock

ANNA, BERT = (Token(name, "operate", hashed(name)) for name in ("Anna", "Bert"))
SCREEN = Token("screen", "view", hashed("screen"))


@pytest.fixture
def clock():
    return HandClock()


def test_an_armed_browser_is_armed_for_a_minute_and_no_longer_than_its_connection(clock):
    browsers = Browsers(clock)
    anna = browsers.connect(ANNA, "10.0.0.1")
    assert browsers.armed(anna.id, ANNA) is None
    assert browsers.arm(anna.id, ANNA) is anna
    clock.now_s += ARMED_S - 0.1
    assert browsers.armed(anna.id, ANNA) is anna
    clock.now_s += 0.2
    assert browsers.armed(anna.id, ANNA) is None
    browsers.arm(anna.id, ANNA)
    browsers.disconnect(anna)
    assert browsers.armed(anna.id, ANNA) is None
    assert browsers.arm(anna.id, ANNA) is None


def test_who_may_look_only_is_never_armed(clock):
    browsers = Browsers(clock)
    screen = browsers.connect(SCREEN, "10.0.0.2")
    assert browsers.arm(screen.id, SCREEN) is None
    assert browsers.armed(screen.id, SCREEN) is None


@pytest.mark.parametrize("token", [SCREEN, BERT, Token("Anna", "operate", hashed("an older token of hers"))])
def test_the_id_of_a_connection_is_of_no_use_with_another_token(clock, token):
    browsers = Browsers(clock)
    anna = browsers.connect(ANNA, "10.0.0.1")
    assert browsers.arm(anna.id, token) is None
    browsers.arm(anna.id, ANNA)
    assert browsers.armed(anna.id, token) is None
    assert not browsers.disarm(anna.id, token)
    assert browsers.armed(anna.id, ANNA) is anna
    assert "another token" in browsers.why_not(anna.id, token)


def test_everybody_sees_who_is_there_and_armed_and_nobody_another_ones_id(clock):
    browsers = Browsers(clock)
    anna, screen = browsers.connect(ANNA, "10.0.0.1"), browsers.connect(SCREEN, "10.0.0.2")
    browsers.arm(anna.id, ANNA)
    clock.now_s += 20.0
    answer = browsers.summary()
    assert [(browser["name"], browser["armed_s"], browser["connected_s"]) for browser in answer] == [
        ("Anna", 40.0, 20.0),
        ("screen", 0.0, 20.0),
    ]
    assert anna.id not in str(answer)
    browsers.disarm(anna.id, ANNA)
    assert browsers.armed(anna.id, ANNA) is None
    assert screen.id != anna.id
