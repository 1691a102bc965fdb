"""Nine comparators on one line whose replies do not say whose they are: a reply may be late by any time.

The comparators stand still, 2 um apart, so that no number looks wrong; each takes 60 ms to answer. Time is virtual.
"""

from __future__ import annotations

import itertools
import math
import threading
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

from compd.conformance.faults import Piece
from compd.conformance.virtual import TURNAROUND_S, VirtualClock, VirtualWire
from compd.gauge import Gauge, Quality, Reading, replies_tell_whose
from compd.lines import Ports
from compd.live.acquisition.acquisition import LineThread
from compd.live.system import System
from compd.plugins import GAUGES, load
from tests.support.patience import PATIENCE_S
from tests.support.sampled import sampled
from tests.support.wire_rig import SETTINGS, WatchedLatest

UNITS = 9
ANSWER_S = 60e-3
TIMEOUT_S = 0.3
SETTINGS_TCP = SETTINGS.validate_python({"kind": "tcp", "host": "x", "port": 1, "timeout_s": TIMEOUT_S})


class Comparators:
    """The far end: units that answer `01` CR, `02` CR ... by their bare measure, unit k shows 2 k um.

    reply : changes what comes back, a list of pieces, by the number of the request from 1 on.
    """

    longest = 12

    def __init__(self, reply: Callable[[int, Piece], Sequence[Piece]] = lambda _, piece: [piece]) -> None:
        self._reply = reply
        self.requests = 0

    def answer(self, request: bytes, received_s: float, timeout_s: float) -> Sequence[Piece]:
        self.requests += 1
        measure = f"+{2e-3 * int(request):08.4f}\r".encode()
        return self._reply(self.requests, Piece(ANSWER_S - TURNAROUND_S, measure))


def comparator(unit: int, form: str = "%+09.4f") -> Gauge[Any]:
    driver = load(GAUGES, "serial_ascii", "test")
    options = {
        "driver": "serial_ascii",
        "line": "line",
        "out": f"{unit:02}",
        "out_terminator": r"\r",
        "in": form,
        "in_terminator": r"\r",
        "channels": [{"name": "x", "unit": "1"}],
    }
    return driver(driver.Options.model_validate(options))


class EndingClock(System):
    """The clock of a virtual wire, which calls `end` once its time has come."""

    def __init__(self, clock: VirtualClock, until_s: float, end: Callable[[], None]) -> None:
        self._clock = clock
        self._until_s = until_s
        self._end = end

    def monotonic(self) -> float:
        if self._clock.now_s > self._until_s:
            self._end()
        return self._clock.now_s

    def wait(self, event: threading.Event, timeout_s: float) -> bool:
        return self._clock.wait(event, timeout_s)


class TimedLatest(WatchedLatest):
    """Also notes when each reading was published."""

    def __init__(self, channels: Sequence[str], clock: VirtualClock) -> None:
        super().__init__(channels)
        self._clock = clock
        self.published_s: list[float] = []

    def put(self, index: int, reading: Reading) -> None:
        self.published_s.append(self._clock.now_s)
        super().put(index, reading)


class Run:
    """One line's thread on a virtual wire, for so many seconds of its time."""

    def __init__(
        self,
        device: Comparators,
        gauges: Sequence[Gauge[Any]],
        seconds: float,
        timeout_s: float = TIMEOUT_S,
        stale_after_s: float = 2.0,
    ) -> None:
        self.wire = VirtualWire(device, registers=False, timeout_s=timeout_s)  # type: ignore[arg-type]
        self.names = [f"c{k}" for k in range(1, len(gauges) + 1)]
        self.latest = TimedLatest([f"{name}.x" for name in self.names], self.wire.clock)
        settings = SETTINGS_TCP.model_copy(update={"timeout_s": timeout_s})
        clock = EndingClock(self.wire.clock, self.wire.clock.now_s + seconds, self._end)

        def opener(settings: Any, system: System, ports: Ports) -> Any:
            return self.wire.open()

        named = list(zip(self.names, gauges, strict=True))
        ages_s = dict.fromkeys(self.names, stale_after_s)
        self.thread = LineThread("line", settings, named, ages_s, self.latest, clock, opener)
        self.thread.start()
        assert self.thread.join(PATIENCE_S)

    def _end(self) -> None:
        self.thread.stop()

    def wrong(self) -> list[str]:
        """Every reading that was published as good and is another comparator's."""
        return [
            f"{name} {reading.value:.4f} at {reading.time_s:.3f} s"
            for name, reading in self.latest.history
            if reading.ok and abs(reading.value - 2e-3 * int(name[1 : name.index(".")])) > 1e-6
        ]

    def oldest_s(self) -> float:
        """The greatest age of the first gauge's last reading when the next one was published, s; inf for a fault."""
        readings = [reading for _, reading in self.latest.history]
        next_published_s = self.latest.published_s[1:]
        ages_s = [then_s - r.time_s for r, then_s in zip(readings, next_published_s, strict=False)]
        return max(ages_s) if all(reading.ok for reading in readings) else math.inf

    def polls(self) -> int:
        return sum(gauge.polls for gauge in self.thread.gauges)

    def good(self) -> int:
        return sum(gauge.ok for gauge in self.thread.gauges)


def late_once(number: int, late_s: float) -> Callable[[int, Piece], Sequence[Piece]]:
    return lambda request, piece: [piece._replace(delay_s=late_s)] if request == number else [piece]


NINE = [comparator(unit) for unit in range(1, UNITS + 1)]


@pytest.mark.parametrize("late_s", sampled([*np.linspace(0.4, 3.0, 30).tolist(), 10.0, 20.0], 4))
def test_one_late_reply_never_shifts_the_comparators(late_s: float) -> None:
    run = Run(Comparators(late_once(30, late_s)), NINE, 5.0 + late_s)
    assert run.wrong() == []
    assert run.good() > 0.7 * run.polls(), "and it costs a few rounds"
    assert run.thread.gauges[2].faults[Quality.TIMEOUT] == 1


@pytest.mark.parametrize("after_s", [0.02, 0.07, 0.1, 0.5, 5.0])
def test_a_reply_that_nobody_asked_for_never_shifts_the_comparators(after_s: float) -> None:
    """The button on a comparator that sends its reading: no request was left without an answer before."""

    def twice(request: int, piece: Piece) -> Sequence[Piece]:
        return [piece, piece._replace(delay_s=piece.delay_s + after_s)] if request == 40 else [piece]

    run = Run(Comparators(twice), NINE, 12.0)
    assert run.wrong() == []
    assert run.good() > 0.8 * run.polls()


def test_late_replies_again_and_again_give_no_wrong_reading() -> None:
    rng = np.random.default_rng(1)
    late = set(range(20, 100_000, 73))

    def reply(request: int, piece: Piece) -> Sequence[Piece]:
        return [piece._replace(delay_s=rng.uniform(0.3, 4.0))] if request in late else [piece]

    run = Run(Comparators(reply), NINE, 1200.0)
    assert run.wrong() == []
    assert run.good() > 0.6 * run.polls()


def test_an_absent_comparator_costs_the_others_little() -> None:
    def without_the_fifth(_: int, piece: Piece) -> Sequence[Piece]:
        return [] if b"0.0100" in piece.data else [piece]

    whole, without = Run(Comparators(), NINE, 60.0), Run(Comparators(without_the_fifth), NINE, 60.0)
    assert without.wrong() == []
    assert without.thread.gauges[4].ok == 0
    assert all(gauge.ok > 0.7 * whole.thread.gauges[0].ok for k, gauge in enumerate(without.thread.gauges) if k != 4)


def test_replies_with_an_address_need_no_silence_at_the_end_of_a_round() -> None:
    """The price of the silence at the end of a round: less than a sixth of nine comparators' rate."""
    addressed = [comparator(unit, f"{unit:02}%+09.4f") for unit in range(1, UNITS + 1)]

    class Addressed(Comparators):
        def answer(self, request: bytes, received_s: float, timeout_s: float) -> Sequence[Piece]:
            (piece,) = super().answer(request, received_s, timeout_s)
            return [piece._replace(data=request[:2] + piece.data)]

    known, unknown = Run(Addressed(), addressed, 60.0), Run(Comparators(), NINE, 60.0)
    assert known.wrong() == unknown.wrong() == []
    assert 5 / 6 * known.good() < unknown.good() < known.good()


@pytest.mark.parametrize("late_s", sampled(np.linspace(0.4, 3.0, 14).tolist(), 4))
def test_a_late_reply_does_not_leave_a_single_gauge_one_reply_behind(late_s: float) -> None:
    """A reading that answers the request before is stamped with the time of this one: its age is understated."""
    counter = itertools.count(1)

    class Counting(Comparators):
        def answer(self, request: bytes, received_s: float, timeout_s: float) -> Sequence[Piece]:
            (piece,) = super().answer(request, received_s, timeout_s)
            heard[number := next(counter)] = received_s
            delay_s = late_s if number == 30 else piece.delay_s
            return [Piece(delay_s, f"+{number:08.4f}\r".encode())]

    heard: dict[int, float] = {}
    run = Run(Counting(), [comparator(1)], 8.0)
    readings = [reading for _, reading in run.latest.history if reading.ok]
    assert len(readings) > 30
    assert [r.time_s for r in readings] == pytest.approx([heard[round(r.value)] for r in readings])


@pytest.mark.parametrize("late_s", sampled(np.linspace(0.32, 3.0, 14).tolist(), 4))
def test_replies_that_are_all_late_from_now_on_never_count(late_s: float) -> None:
    counter = itertools.count(1)

    class Late(Comparators):
        def answer(self, request: bytes, received_s: float, timeout_s: float) -> Sequence[Piece]:
            (piece,) = super().answer(request, received_s, timeout_s)
            heard[number := next(counter)] = received_s
            delay_s = late_s if number >= 30 else piece.delay_s
            return [Piece(delay_s, f"+{number:08.4f}\r".encode())]

    heard: dict[int, float] = {}
    run = Run(Late(), [comparator(1)], 20.0)
    readings = [reading for _, reading in run.latest.history if reading.ok]
    assert len(readings) > 20
    assert [r.time_s for r in readings] == pytest.approx([heard[round(r.value)] for r in readings])


# How many of every forty replies in a row are lost, at a timeout of so many seconds.
@pytest.mark.parametrize(("lost", "timeout_s"), [(1, 0.1), (1, 0.15), (1, 0.2), (2, 0.1), (2, 0.15), (3, 0.1)])
def test_a_display_that_loses_replies_in_a_row_is_never_stale(lost: int, timeout_s: float) -> None:
    """At 0.5 s, as both example configurations have it; the display takes 30 ms to answer."""

    class Display(Comparators):
        def answer(self, request: bytes, received_s: float, timeout_s: float) -> Sequence[Piece]:
            (piece,) = super().answer(request, received_s, timeout_s)
            return [] if self.requests % 40 >= 40 - lost else [piece._replace(delay_s=30e-3)]

    run = Run(Display(), [comparator(1)], 60.0, timeout_s, stale_after_s=0.5)
    assert run.thread.gauges[0].faults[Quality.TIMEOUT] > 20 * lost
    assert run.oldest_s() < 0.5


@pytest.mark.parametrize("pause_s", [0.1, 0.16, 0.2, 0.25])
def test_a_display_that_stands_still_for_a_moment_is_never_stale(pause_s: float) -> None:
    """Then it answers every request that it has heard meanwhile, 10 ms each."""

    class Display(Comparators):
        free_s = 0.0

        def answer(self, request: bytes, received_s: float, timeout_s: float) -> Sequence[Piece]:
            (piece,) = super().answer(request, received_s, timeout_s)
            self.free_s = max(self.free_s, received_s) + (pause_s if self.requests % 60 == 0 else 10e-3)
            return [piece._replace(delay_s=self.free_s - received_s)]

    run = Run(Display(), [comparator(1)], 60.0, 0.15, stale_after_s=0.5)
    assert run.thread.gauges[0].polls > 2000
    assert run.oldest_s() < 0.5


@pytest.mark.parametrize("seed", sampled(range(40), 5))
def test_whatever_is_late_or_lost_a_single_gauge_answers_the_request_it_is_stamped_with(seed: int) -> None:
    """Replies come in the order of their requests: in some stretches one in ten is lost, in others each is late."""
    rng = np.random.default_rng(seed)
    counter = itertools.count(1)

    class Troubled(Comparators):
        late_until_s, late_s, free_s = 0.0, 0.0, 0.0

        def answer(self, request: bytes, received_s: float, timeout_s: float) -> Sequence[Piece]:
            heard[number := next(counter)] = received_s
            if received_s > self.late_until_s and rng.random() < 0.02:
                self.late_until_s, self.late_s = received_s + rng.uniform(0.0, 3.0), rng.uniform(0.05, 1.5)
            late_s = self.late_s if received_s < self.late_until_s else 0.0
            if not late_s and rng.random() < 0.1:
                return []
            self.free_s = max(self.free_s, received_s + 8e-3 + late_s)
            return [Piece(self.free_s - received_s, f"+{number:08.4f}\r".encode())]

    heard: dict[int, float] = {}
    run = Run(Troubled(), [comparator(1)], 60.0, 0.15, stale_after_s=0.5)
    readings = [reading for _, reading in run.latest.history if reading.ok]
    assert len(readings) > 100
    assert [r.time_s for r in readings] == pytest.approx([heard[round(r.value)] for r in readings])


def test_identities_differ_only_where_none_begins_another() -> None:
    assert replies_tell_whose([comparator(1, "A%+09.4f"), comparator(2, "B%+09.4f")])
    assert not replies_tell_whose([comparator(1, "1%+09.4f"), comparator(2, "12%+09.4f")])
    assert not replies_tell_whose([comparator(1, "A%+09.4f"), comparator(2)])
    assert not replies_tell_whose([comparator(1, "%+09.4fA"), comparator(2, "%+09.4fB")]), "only its beginning counts"
    assert replies_tell_whose([comparator(1)])
