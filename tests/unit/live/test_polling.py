"""Polling in turn, rest and back-off of gauges and lines, on scripted lines in simulated time."""

from __future__ import annotations

import json
import math
import threading
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import pytest
import structlog

from compd.clock import Clock, MonotonicClock
from compd.gauge import Channel, Gauge, LineFault, Quality, Reading, bad, good
from compd.live.acquisition.acquisition import LineThread
from compd.live.memory.poll_requests import PollRequests
from compd.live.service.message_keys.status import LineStatusKeys
from tests.support.wire_rig import PATIENCE_S, SETTINGS, InstantClock, WatchedLatest

OK = Quality.OK
BACK_OFF_S = (0.05, 0.2)
STALE_AFTER_S = 0.5
SETTINGS_TCP = SETTINGS.validate_python({"kind": "tcp", "host": "x", "port": 1, "timeout_s": 0.1})


class Line:
    """A line that only counts what acquisition does with it."""

    last_request_s = -math.inf
    unexpected_bytes = 0
    request_came_back = False

    def __init__(self) -> None:
        self.drained = 0
        self.closed = False

    def drain(self, quiet_s: float | None = None) -> bytes:
        self.drained += 1
        return b""

    def close(self) -> None:
        self.closed = True


class Scripted(Gauge[Any]):
    """A driver that does what `poll` does."""

    def __init__(self, poll: Callable[[], Sequence[Any]], channels: int = 1) -> None:
        super().__init__(None)
        self._poll = poll
        self._channels = [Channel(f"c{i}") for i in range(channels)]

    @property
    def channels(self) -> Sequence[Channel]:
        return self._channels

    def read(self, line: Any) -> Sequence[Reading]:
        return self._poll()


class Stop(Exception):
    """Ends a script."""


class ScriptedThread:
    """One LineThread on an InstantClock, run to the end of its script on its own thread."""

    def __init__(self, *drivers: Gauge[Any], opener: Any = None, settings: Any = SETTINGS_TCP) -> None:
        self.clock = InstantClock()
        self.lines: list[Line] = []
        names = [(f"g{i}", driver) for i, driver in enumerate(drivers)]
        self.latest = WatchedLatest([f"{name}.{c.name}" for name, driver in names for c in driver.channels])
        stale_after_s = {name: STALE_AFTER_S for name, _ in names}
        self.poll_requests = PollRequests([name for name, _ in names])
        self.thread = LineThread(
            "line",
            settings,
            names,
            stale_after_s,
            self.latest,
            self.clock,
            opener or self.open,
            poll_requests=self.poll_requests,
        )

    def open(self, settings: Any, clock: Clock) -> Line:
        self.lines.append(Line())
        return self.lines[-1]

    def run(self) -> None:
        self.thread.start()
        assert self.thread.join(PATIENCE_S)
        assert self.thread.status()["state"] == "stopped"
        assert all(line.closed for line in self.lines)
        LineStatusKeys.model_validate_json(json.dumps(self.thread.status(), allow_nan=False))

    def qualities(self, channel: str) -> list[Quality]:
        return [reading.quality for name, reading in self.latest.history if name == channel]


def test_a_line_that_cannot_be_opened_is_tried_again_later_and_later() -> None:
    def closed(settings: Any, clock: Clock) -> Line:
        raise LineFault(Quality.LINE_LOST, "cannot open it")

    scripted = ScriptedThread(Scripted(lambda: []), opener=closed)
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

    scripted = ScriptedThread(Scripted(poll))
    scripted.run()
    assert len(scripted.lines) == 4
    assert scripted.thread.status()["lost"] == 3
    assert [wait for wait in scripted.clock.waits_s if wait >= 0.5] == [0.5, 1.0, 0.5]


def test_an_absent_unit_rests_and_the_others_go_on() -> None:
    def present() -> list[Reading]:
        scripted.clock.now_s += 0.01
        if scripted.clock.now_s > 120.0:
            scripted.thread.stop()
        return [good(1.0, scripted.clock.now_s)]

    def absent() -> list[Reading]:
        scripted.clock.now_s += 0.1
        raise LineFault(Quality.TIMEOUT, "no byte")

    scripted = ScriptedThread(Scripted(present), Scripted(absent))
    scripted.run()
    status = scripted.thread.status()["gauges"]
    assert status["g1"]["faults"] == {"timeout": status["g1"]["polls"]}
    assert status["g1"]["polls"] == 22, "rests of 0.1, 0.2, 0.4 and 0.8 s, then of 0.9 s"
    assert status["g0"]["polls"] > 1000
    assert scripted.lines[0].drained == 0, "a miss costs the others one timeout"


def test_a_unit_that_answers_again_is_polled_at_full_pace() -> None:
    polls = 0

    def poll() -> list[Reading]:
        nonlocal polls
        polls += 1
        if polls <= 3:
            scripted.clock.now_s += 0.1
            raise LineFault(Quality.TIMEOUT, "no byte")
        scripted.clock.now_s += 0.01
        return [good(float(polls), scripted.clock.now_s)]

    def other() -> list[Reading]:
        scripted.clock.now_s += 0.01
        if scripted.clock.now_s > 102.0:
            scripted.thread.stop()
        return [good(1.0, scripted.clock.now_s)]

    scripted = ScriptedThread(Scripted(poll), Scripted(other))
    scripted.run()
    times_s = [reading.time_s for name, reading in scripted.latest.history if name == "g0.c0" and reading.ok]
    assert times_s[0] == pytest.approx(100.0 + 3 * 0.1 + 0.1 + 0.2 + 0.4, abs=0.06), "a rest after each miss"
    assert times_s[-1] - times_s[0] == pytest.approx(0.02 * (len(times_s) - 1)), "then at once"


def test_a_gauge_with_a_line_of_its_own_rests_only_once_its_reading_is_stale() -> None:
    scripted = polls_with_faults(None, *[LineFault(Quality.TIMEOUT, "no byte")] * 7)
    rests_s = [wait for wait in scripted.clock.waits_s if wait >= 0.05]
    assert rests_s == pytest.approx([0.9, 0.9]), "after five misses, of 0.1 s each, it goes on as if it had rested"


def test_a_channel_that_is_always_faulty_does_not_make_its_neighbours_rest() -> None:
    polls = 0

    def poll() -> list[Reading]:
        nonlocal polls
        polls += 1
        scripted.clock.now_s += 0.1
        if polls == 10:
            scripted.thread.stop()
        if polls % 2 == 0:
            raise LineFault(Quality.TIMEOUT, "no byte")
        return [good(1.0, scripted.clock.now_s), bad(scripted.clock.now_s, Quality.SENSOR_FAULT)]

    scripted = ScriptedThread(Scripted(poll, channels=2))
    scripted.run()
    assert [wait for wait in scripted.clock.waits_s if wait >= 0.05] == []


def test_one_damaged_reply_costs_no_rest_but_a_drain() -> None:
    polls = 0

    def poll() -> list[Reading]:
        nonlocal polls
        polls += 1
        scripted.clock.now_s += 0.01
        if polls == 1:
            raise LineFault(Quality.CRC, "b'..'")
        if polls == 2:
            raise LineFault(Quality.DEVICE_ERROR, "busy")
        scripted.thread.stop()
        return [good(1.0, scripted.clock.now_s)]

    scripted = ScriptedThread(Scripted(poll))
    scripted.run()
    assert scripted.lines[0].drained == 1, "after a device's own error nothing is under way"
    assert [wait for wait in scripted.clock.waits_s if wait >= 0.05] == pytest.approx([0.1]), (
        "the second in a row rests"
    )


def polls_with_faults(*faults: LineFault | None, period_s: float = 0.1) -> ScriptedThread:
    """A gauge polled once per fault, `period_s` apart: with None it is well and shows the number of the poll."""
    left = list(enumerate(faults, start=1))

    def poll() -> list[Reading]:
        number, fault = left.pop(0)
        scripted.clock.now_s += period_s
        if not left:
            scripted.thread.stop()
        if fault is not None:
            raise fault
        return [good(float(number), scripted.clock.now_s)]

    scripted = ScriptedThread(Scripted(poll))
    scripted.run()
    return scripted


@pytest.mark.parametrize("quality", [Quality.TIMEOUT, Quality.INCOMPLETE, Quality.CRC, Quality.MISMATCH])
def test_a_good_reading_outlives_a_fault_of_the_wire(quality: Quality) -> None:
    scripted = polls_with_faults(None, LineFault(quality, "noise"), None)
    assert scripted.qualities("g0.c0") == [OK, OK]
    status = scripted.thread.status()["gauges"]["g0"]
    assert (status["polls"], status["ok"], status["faults"]) == (3, 2, {str(quality): 1})


def test_a_good_reading_goes_when_it_is_stale() -> None:
    missing = LineFault(Quality.TIMEOUT, "no byte")
    scripted = polls_with_faults(None, *[missing] * 7)
    (_, last), (_, first_missing), *_ = scripted.latest.history
    assert (last.quality, first_missing.quality) == (OK, Quality.TIMEOUT)
    assert first_missing.time_s - last.time_s > STALE_AFTER_S
    assert scripted.thread.gauges[0].faults[Quality.TIMEOUT] == 7
    assert len(scripted.latest.history) < 8, "the first of them took nothing away"


@pytest.mark.parametrize("quality", [Quality.DEVICE_ERROR, Quality.SILENT, Quality.SENSOR_FAULT, Quality.LINE_LOST])
def test_what_the_device_or_the_port_says_takes_a_reading_at_once(quality: Quality) -> None:
    scripted = polls_with_faults(None, LineFault(quality, "said so"))
    assert scripted.qualities("g0.c0") == [OK, quality]


def test_a_library_that_raises_anything_loses_the_line_and_not_its_thread() -> None:
    tries = 0

    def failing(settings: Any, clock: Clock) -> Line:
        nonlocal tries
        tries += 1
        if tries <= 2:
            raise NotImplementedError("write_timeout is currently not supported")
        return scripted.open(settings, clock)

    def poll() -> list[Reading]:
        scripted.thread.stop()
        return [good(1.0, scripted.clock.now_s)]

    scripted = ScriptedThread(Scripted(poll), opener=failing)
    with structlog.testing.capture_logs() as logs:
        scripted.run()
    assert scripted.qualities("g0.c0") == [Quality.LINE_LOST, Quality.LINE_LOST, OK]
    assert scripted.clock.waits_s[:2] == [0.5, 1.0], "the back-off of the line"
    assert [entry["detail"] for entry in logs if entry["event"] == "line is lost"] == [
        "NotImplementedError: write_timeout is currently not supported"
    ]
    assert len([entry for entry in logs if entry["event"] == "line failed"]) == 1, "with a traceback, once"


def test_a_line_that_fails_while_it_is_drained_or_closed_is_lost_too() -> None:
    class Broken(Line):
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

    def opener(settings: Any, clock: Clock) -> Line:
        scripted.lines.append(Broken())
        return scripted.lines[-1]

    scripted = ScriptedThread(Scripted(poll), opener=opener)
    scripted.run()
    assert scripted.qualities("g0.c0") == [Quality.LINE_LOST, OK]


@pytest.mark.parametrize(
    "answer",
    [
        ZeroDivisionError("a defect"),
        Stop("an exception of the driver's own"),
        [],
        [good(1.0, 1.0), good(1.0, 1.0)],
        [Reading(math.nan, 1.0, OK)],
        [Reading(math.inf, 1.0, OK)],
        [Reading(1.0, math.nan, OK)],
        [Reading(1.0, 1e9, OK)],
        [None],
        None,
    ],
    ids=repr,
)
def test_a_defect_of_a_driver_is_named_logged_once_and_survived(answer: Any) -> None:
    polls = 0

    def poll() -> Any:
        nonlocal polls
        polls += 1
        if polls > 2:
            scripted.thread.stop()
            return [good(5.0, scripted.clock.now_s)]
        if isinstance(answer, Exception):
            raise answer
        return answer

    scripted = ScriptedThread(Scripted(poll))
    with structlog.testing.capture_logs() as logs:
        scripted.run()
    assert scripted.qualities("g0.c0") == [Quality.DRIVER_ERROR, Quality.DRIVER_ERROR, OK]
    assert len([entry for entry in logs if entry["event"] == "driver failed"]) == 1
    assert scripted.thread.status()["gauges"]["g0"]["faults"] == {"driver_error": 2}


def test_channels_of_one_poll_have_their_own_qualities() -> None:
    def poll() -> list[Reading]:
        scripted.thread.stop()
        now_s = scripted.clock.now_s
        return [good(1.0, now_s), Reading(math.nan, now_s, Quality.SENSOR_FAULT, "?"), good(math.inf, now_s)]

    scripted = ScriptedThread(Scripted(poll, channels=3))
    scripted.run()
    assert [scripted.qualities(f"g0.c{i}") for i in range(3)] == [[OK], [Quality.SENSOR_FAULT], [Quality.NOT_FINITE]]
    status = scripted.thread.status()["gauges"]["g0"]
    assert status["polls"] == 1
    assert status["ok"] == 0
    assert status["faults"] == {"sensor_fault": 1, "not_finite": 1}
    assert "last_ok_s" not in status


def test_rounds_keep_the_pace_that_is_configured() -> None:
    polls = 0

    def poll() -> list[Reading]:
        nonlocal polls
        polls += 1
        scripted.clock.now_s += 0.03
        if polls == 10:
            scripted.thread.stop()
        return [good(1.0, scripted.clock.now_s)]

    scripted = ScriptedThread(Scripted(poll), settings=SETTINGS_TCP.model_copy(update={"poll_every_s": 0.1}))
    scripted.run()
    assert scripted.clock.waits_s[:9] == pytest.approx([0.07] * 9)
    assert scripted.thread.status()["round_s"] == pytest.approx(0.03)


def test_stopping_cuts_a_back_off_short() -> None:
    tried = threading.Event()

    def closed(settings: Any, clock: Clock) -> Line:
        tried.set()
        raise LineFault(Quality.LINE_LOST, "no")

    settings = SETTINGS_TCP.model_copy(update={"back_off_s": (1e6, 1e6)})
    latest = WatchedLatest(["g.c0"])
    gauges = [("g", Scripted(lambda: []))]
    thread = LineThread("line", settings, gauges, {"g": STALE_AFTER_S}, latest, MonotonicClock(), closed)
    thread.start()
    assert tried.wait(PATIENCE_S)
    thread.stop()
    assert thread.join(PATIENCE_S)


# --- A unit whose silence makes the others stale --------------------------------------------------------------


class SlowBus:
    """Six gauges in virtual time, 10 ms each, and `wait_s` for one that is dead; which snapshots had fresh readings."""

    UNITS = 6

    def __init__(self, wait_s: float, until_s: float, quality: Quality) -> None:
        self.dead: set[int] = set()
        self.asked: list[tuple[int, float]] = []
        self.last_s = [0.0] * self.UNITS
        self.stale: list[tuple[float, float]] = []  # from, to: one of those that live had no fresh reading
        self._wait_s = wait_s
        self._until_s = until_s
        self._quality = quality
        self.scripted = ScriptedThread(*[Scripted(lambda unit=unit: self.poll(unit)) for unit in range(self.UNITS)])
        self.start_s = self.scripted.clock.now_s
        self.last_s = [self.start_s] * self.UNITS
        self.at: dict[float, Callable[[], None]] = {}

    def poll(self, unit: int) -> list[Reading]:
        clock = self.scripted.clock
        for time_s in [time_s for time_s in self.at if clock.now_s - self.start_s >= time_s]:
            self.at.pop(time_s)()
        if clock.now_s - self.start_s > self._until_s:
            self.scripted.thread.stop()
        self.asked.append((unit, clock.now_s - self.start_s))
        if unit in self.dead:
            clock.now_s += self._wait_s
            raise LineFault(self._quality, "no answer")
        clock.now_s += 0.01
        if clock.now_s - self.last_s[unit] > STALE_AFTER_S:
            self.stale.append((self.last_s[unit] + STALE_AFTER_S - self.start_s, clock.now_s - self.start_s))
        self.last_s[unit] = clock.now_s
        return [good(1.0, clock.now_s)]

    def times_s(self, unit: int) -> list[float]:
        return [time_s for asked, time_s in self.asked if asked == unit]

    def stale_share(self, from_s: float, to_s: float) -> float:
        """Part of that time in which a gauge had no fresh reading; at most: several may have been stale at once."""
        spans = [(max(begin, from_s), min(end, to_s)) for begin, end in self.stale]
        instants = [from_s + 0.01 * k for k in range(int((to_s - from_s) / 0.01))]
        return sum(any(a <= t < b for a, b in spans) for t in instants) / len(instants)


@pytest.mark.parametrize("quality", [Quality.TIMEOUT, Quality.DEVICE_ERROR])
def test_a_unit_that_makes_the_others_stale_is_asked_seldom(quality: Quality) -> None:
    bus = SlowBus(1.0, 610.0, quality)
    bus.at[10.0] = lambda: bus.dead.add(2)
    with structlog.testing.capture_logs() as logs:
        bus.scripted.run()
    asked_s = [time_s for time_s in bus.times_s(2) if time_s > 10.0]
    assert len(asked_s) == 2 + 5, "twice at first, then after a hundred times the second that each one costs"
    assert bus.stale_share(10.0, 30.0) < 0.08
    assert bus.stale_share(30.0, 600.0) < 0.01
    (event,) = [entry for entry in logs if entry["event"] == "gauge is asked seldom"]
    assert (event["gauge"], event["cost_s"], event["rest_s"]) == ("g2", pytest.approx(1.01), pytest.approx(101.0))


def test_a_unit_that_is_asked_seldom_is_asked_at_once_where_a_client_wants_it() -> None:
    bus = SlowBus(1.0, 90.0, Quality.TIMEOUT)
    bus.at[10.0] = lambda: bus.dead.add(2)
    for time_s in (40.0, 60.0):
        bus.at[time_s] = lambda: bus.scripted.poll_requests.add("g2")
    bus.at[50.0] = bus.dead.clear
    bus.scripted.run()
    asked_s = [time_s for time_s in bus.times_s(2) if time_s > 30.0]
    assert asked_s[0] == pytest.approx(40.0, abs=0.2)
    assert asked_s[1] == pytest.approx(60.0, abs=0.2), "it did not answer at 40 s, and rests again"
    assert asked_s[2] < 60.5
    assert bus.scripted.latest.wait_for("g2.c0", Quality.OK).ok


def test_a_unit_that_misses_once_is_asked_again_within_a_second() -> None:
    bus = SlowBus(1.0, 60.0, Quality.TIMEOUT)
    for time_s in (10.0, 20.0, 30.0):
        bus.at[time_s] = lambda: bus.dead.add(2)
        bus.at[time_s + 0.5] = bus.dead.clear
    bus.scripted.run()
    asked_s = bus.times_s(2)
    assert max(late - soon for soon, late in pairwise(asked_s)) < 2.0


def test_units_that_come_back_together_are_all_asked_within_a_second() -> None:
    bus = SlowBus(1.0, 100.0, Quality.TIMEOUT)
    bus.at[10.0] = lambda: bus.dead.update(range(6))
    bus.at[60.0] = bus.dead.clear
    bus.scripted.run()
    back_s = [min(time_s for time_s in bus.times_s(unit) if time_s > 60.0) for unit in range(6)]
    assert max(back_s) < 63.0
