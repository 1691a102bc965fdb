"""`compd watch`: what it shows expires by `valid_until`, whatever has stopped."""

from __future__ import annotations

import io
import threading
from types import SimpleNamespace

import pytest
from rich.console import Console

from compd.cli.live.watch import NewestSetpoint
from compd.errors import DaemonError
from tests.support.patience import PATIENCE_S

STATUS = {"time_s": 0.0, "loop": {"rate_hz": 200, "missed_cycles": 0}, "gauges": []}
SETPOINT = {
    "seq": 7,
    "time_s": 100.0,
    "valid_until": 100.1,
    "valid": True,
    "state": "ok",
    "reason": "",
    "mode": "cmm",
    "tip_M_mm": [1.0, 2.0, 190.0],
    "frame": {"displacement_M_mm": [0.0] * 3, "rotation_M_rad": [0.0] * 3},
    "link_length_mm": [481.0] * 3,
    "correction_mm": [0.001] * 3,
    "sources_mm": {"joints": [0.001] * 3},
}


class Daemon:
    """A client of a daemon that sends one setpoint; then it is silent, until it `dies`."""

    def __init__(self):
        self.version = {"machine": "tripod"}
        self.sent, self.dies = threading.Event(), threading.Event()

    def status(self):
        return STATUS

    def watch(self, rate_hz):
        yield SETPOINT
        self.sent.set()
        assert self.dies.wait(PATIENCE_S)
        raise DaemonError.of("here", "the daemon is gone")


@pytest.fixture(params=[False, True], ids=["other computer", "same computer"])
def shown(request):
    daemon, clock = Daemon(), SimpleNamespace(monotonic=lambda: clock.now_s, now_s=100.0)
    newest = NewestSetpoint(daemon, 10.0, clock, request.param)
    assert daemon.sent.wait(PATIENCE_S)

    def text():
        console = Console(width=80, record=True, file=io.StringIO())
        console.print(newest.picture())
        return console.export_text()

    yield SimpleNamespace(daemon=daemon, clock=clock, newest=newest, text=text)
    daemon.dies.set()


def test_a_setpoint_is_shown_as_long_as_it_is_valid_and_then_nothing_of_it(shown):
    shown.clock.now_s += 0.09
    assert "OK" in shown.text()
    assert "190.00000" in shown.text()
    shown.clock.now_s += 0.02
    assert shown.newest.has_expired
    text = shown.text()
    assert "NO SETPOINT" in text
    assert not {"OK", "190.00000", "481.0"} & set(text.split())
    shown.clock.now_s += 4.0
    assert "4.0 s ago" in shown.text()


def test_when_the_daemon_is_gone_no_number_stays_on_the_screen(shown):
    shown.daemon.dies.set()
    with pytest.raises(DaemonError, match="gone"):
        shown.newest.wait(PATIENCE_S)
    assert "190.00000" not in shown.text()
    assert "NO SETPOINT" in shown.text()
