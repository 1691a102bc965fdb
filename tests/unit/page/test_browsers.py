"""Which browser is armed, and for how long."""

from __future__ import annotations

import pytest

from compd.page.browsers import ARMED_S, Browsers
from tests.support.hand_clock import HandClock


@pytest.fixture
def clock():
    return HandClock()


def test_an_armed_browser_is_armed_for_a_minute_and_no_longer_than_its_connection(clock):
    browsers = Browsers(clock)
    anna = browsers.connect("Anna", "10.0.0.1", "operate")
    assert browsers.armed(anna.id) is None
    assert browsers.arm(anna.id) is anna
    clock.now_s += ARMED_S - 0.1
    assert browsers.armed(anna.id) is anna
    clock.now_s += 0.2
    assert browsers.armed(anna.id) is None
    browsers.arm(anna.id)
    browsers.disconnect(anna)
    assert browsers.armed(anna.id) is None
    assert browsers.arm(anna.id) is None


def test_who_may_look_only_is_never_armed(clock):
    browsers = Browsers(clock)
    screen = browsers.connect("screen", "10.0.0.2", "view")
    assert browsers.arm(screen.id) is None
    assert browsers.armed(screen.id) is None


def test_everybody_sees_who_is_there_and_armed_and_nobody_another_ones_id(clock):
    browsers = Browsers(clock)
    anna, screen = browsers.connect("Anna", "10.0.0.1", "operate"), browsers.connect("screen", "10.0.0.2", "view")
    browsers.arm(anna.id)
    clock.now_s += 20.0
    answer = browsers.summary()
    assert [(browser["name"], browser["armed_s"], browser["connected_s"]) for browser in answer] == [
        ("Anna", 40.0, 20.0),
        ("screen", 0.0, 20.0),
    ]
    assert anna.id not in str(answer)
    browsers.disarm(anna.id)
    assert browsers.armed(anna.id) is None
    assert screen.id != anna.id
