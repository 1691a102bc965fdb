"""The demo with a client that is late for each setpoint: its result is right, or there is none."""

from __future__ import annotations

import threading

import pytest

from compd.configuration import load
from compd.demo.session import DemoSession, run_demo
from tests.support.paths import CONFIG

SECONDS = 20.0
# Tip error with joints and frame compensated, rms, um.
RIGHT_UM = 0.5

pytestmark = [pytest.mark.long, pytest.mark.sample]


def late_demo(name: str, late_s: float) -> DemoSession:
    """A demo whose client takes so much longer for each setpoint."""
    never = threading.Event()

    def be_late(*_: object) -> None:
        never.wait(late_s)

    return run_demo(load(CONFIG / name), SECONDS, 1, be_late)


@pytest.mark.parametrize("name", ["tripod-cmm.yaml", "hexapod.yaml"])
def test_a_client_that_is_late_by_less_than_a_period_gets_the_right_result(name: str) -> None:
    session = late_demo(name, 0.015)
    assert session.shortcoming == ""
    assert session.rms_um("full") < RIGHT_UM


def test_a_client_that_is_late_by_periods_gets_the_right_result_or_none() -> None:
    session = late_demo("tripod-cmm.yaml", 0.06)
    assert session.shortcoming or session.rms_um("full") < RIGHT_UM
