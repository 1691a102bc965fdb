"""Lines that are lost, or cannot be opened, on scripted lines in simulated time."""

from __future__ import annotations

import threading
from typing import Any

import structlog

from compd.gauge import LineFault, Quality, Reading, good
from compd.lines import Ports
from compd.live.acquisition.acquisition import LineThread
from compd.live.system import THIS_COMPUTER, System
from tests.support.patience import PATIENCE_S
from tests.support.scripted_thread import SETTINGS_TCP, STALE_AFTER_S, CountingLine, ScriptedGauge, ScriptedThread
from tests.support.wire_rig import WatchedLatest

OK = Quality.OK


def test_a_line_that_cannot_be_opened_is_tried_again_later_and_later() -> None:
    def closed(settings: Any, system: System, ports: Ports) -> CountingLine:
        raise LineFault(Quality.LINE_LOST, "cannot open it")

    scripted = ScriptedThread(ScriptedGauge(lambda: []), opener=closed)
    scripted.clock.on_wait = lambda: scripted.thread.stop() if len(scripted.clock.waits_s) == 7 else None
    scripted.run()
    assert scripted.clock.waits_s == [0.5, 1.0, 2.0, 4.0, 8.0, 10.0, 10.0]
    assert scripted.qualities("g0.c0") == [Quality.LINE_LOST] * 7
    assert scripted.thread.status()["lost"] == 1
    assert "cannot open it" in scripted.thread.status()["detail"]


def test_a_lost_line_is_closed_and_made_anew_and_success_shortens_the_wait() -> None:
    polls = 0

    def poll() -> list[Reading]:
        nonlocal polls
        polls += 1
        if polls in (2, 3, 5):
            raise LineFault(Quality.LINE_LOST, "pulled")
        if polls == 6:
            scripted.thread.stop()
        return [good(1.0, scripted.clock.now_s)]

    scripted = ScriptedThread(ScriptedGauge(poll))
    scripted.run()
    assert len(scripted.lines) == 4
    assert scripted.thread.status()["lost"] == 3
    assert [wait for wait in scripted.clock.waits_s if wait >= 0.5] == [0.5, 1.0, 0.5]


def test_a_library_that_raises_anything_loses_the_line_and_not_its_thread() -> None:
    tries = 0

    def failing(settings: Any, system: System, ports: Ports) -> CountingLine:
        nonlocal tries
        tries += 1
        if tries <= 2:
            raise NotImplementedError("write_timeout is currently not supported")
        return scripted.open(settings, system, ports)

    def poll() -> list[Reading]:
        scripted.thread.stop()
        return [good(1.0, scripted.clock.now_s)]

    scripted = ScriptedThread(ScriptedGauge(poll), opener=failing)
    with structlog.testing.capture_logs() as logs:
        scripted.run()
    assert scripted.qualities("g0.c0") == [Quality.LINE_LOST, Quality.LINE_LOST, OK]
    assert scripted.clock.waits_s[:2] == [0.5, 1.0], "the back-off of the line"
    assert [entry["detail"] for entry in logs if entry["event"] == "line is lost"] == [
        "NotImplementedError: write_timeout is currently not supported"
    ]
    assert len([entry for entry in logs if entry["event"] == "line failed"]) == 1, "with a traceback, once"


def test_a_line_that_fails_while_it_is_drained_or_closed_is_lost_too() -> None:
    class Broken(CountingLine):
        def drain(self, quiet_s: float | None = None) -> bytes:
            raise RuntimeError("no such thing")

        def close(self) -> None:
            super().close()
            raise RuntimeError("nor this")

    polls = 0

    def poll() -> list[Reading]:
        nonlocal polls
        polls += 1
        if polls == 1:
            raise LineFault(Quality.CRC, "noise")
        scripted.thread.stop()
        return [good(1.0, scripted.clock.now_s)]

    def opener(settings: Any, system: System, ports: Ports) -> CountingLine:
        scripted.lines.append(Broken())
        return scripted.lines[-1]

    scripted = ScriptedThread(ScriptedGauge(poll), opener=opener)
    scripted.run()
    assert scripted.qualities("g0.c0") == [Quality.LINE_LOST, OK]


def test_stopping_cuts_a_back_off_short() -> None:
    tried = threading.Event()

    def closed(settings: Any, system: System, ports: Ports) -> CountingLine:
        tried.set()
        raise LineFault(Quality.LINE_LOST, "no")

    settings = SETTINGS_TCP.model_copy(update={"back_off_s": (1e6, 1e6)})
    latest = WatchedLatest(["g.c0"])
    gauges = [("g", ScriptedGauge(lambda: []))]
    thread = LineThread("line", settings, gauges, {"g": STALE_AFTER_S}, latest, THIS_COMPUTER, closed)
    thread.start()
    assert tried.wait(PATIENCE_S)
    thread.stop()
    assert thread.join(PATIENCE_S)
