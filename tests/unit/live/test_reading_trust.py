"""Readings of a length that are believed, and those that are not: damage, jumps, gauges that come back."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import pytest

from compd.gauge import Channel, Gauge, GaugeOptions, LineFault, Quality, Reading, good
from compd.live.acquisition.polled_gauge import PolledGauge
from compd.live.acquisition.possible_motion import MotionLimits, unseen_jump_mm
from compd.live.acquisition.reading_trust import ReadingTrust, TrustSettings
from compd.live.memory.latest import Latest
from compd.live.memory.readings import pack
from compd.live.memory.trust_memory import TrustMemory
from compd.plugins import GAUGES as GAUGES_GROUP
from compd.plugins import load, names
from compd.stated_noise import tolerance_mm

NOISE_UM = 0.1
POLL_S = 0.005
REPLY_S = 0.003
STALE_AFTER_S = 0.5
RESTART_S = 0.5
LIMITS = MotionLimits(speed=60.0, acceleration=400.0)
GAUGES = ("scale_1", "scale_2", "scale_3")


class Shop:
    """Three scales on lines of their own, polled in turn in simulated time; what they show is set by the test."""

    def __init__(self, limits: MotionLimits = LIMITS, returns_by_itself: bool = False) -> None:
        self.now_s = 1000.0
        self.shows: dict[str, Callable[[float], float]] = {name: lambda _: 0.0 for name in GAUGES}
        self.damage: dict[str, list[float | LineFault]] = {name: [] for name in GAUGES}
        self.asked = dict.fromkeys(GAUGES, 0)
        self.latest = Latest([f"{name}.value" for name in GAUGES])
        self.memory = TrustMemory(self.latest.channels, [tolerance_mm(NOISE_UM)] * len(GAUGES), scales=len(GAUGES))
        self._settings = TrustSettings(limits, returns_by_itself, STALE_AFTER_S, RESTART_S)
        self._random = np.random.default_rng(5)
        self.start_acquisition()

    def start_acquisition(self) -> None:
        """As a new process would."""
        self.gauges = {}
        for name in GAUGES:
            trust = {f"{name}.value": ReadingTrust(self.memory, f"{name}.value", self._settings)}
            self.gauges[name] = PolledGauge(name, Scale(self, name), self.latest, 0.1, STALE_AFTER_S, self, trust)

    def monotonic(self) -> float:
        return self.now_s

    def wait(self, event: object, timeout_s: float) -> bool:
        raise AssertionError("nothing waits here")

    def ask(self, name: str) -> Reading:
        self.asked[name] += 1
        time_s = self.now_s
        self.now_s += REPLY_S
        value = self.shows[name](time_s) + NOISE_UM * 1e-3 * self._random.standard_normal()
        damage = self.damage[name].pop(0) if self.damage[name] else 0.0
        if isinstance(damage, LineFault):
            raise damage
        return good(value + damage, time_s)

    def poll(self, rounds: int = 1, without: Sequence[str] = ()) -> None:
        for _ in range(rounds):
            for name, gauge in self.gauges.items():
                if name in without:
                    continue
                try:
                    gauge.put(gauge.read(None), self.now_s)
                except LineFault as fault:
                    gauge.fail(fault.quality, fault.detail, self.now_s)
            self.now_s += POLL_S

    def lose(self, *names: str) -> None:
        """As the thread of a lost line does."""
        for name in names:
            self.gauges[name].lose(Quality.LINE_LOST, "unplugged", self.now_s)

    def reading(self, name: str) -> Reading:
        return self.latest.snapshot(self.now_s).readings[GAUGES.index(name)]

    def away_s(self, duration_s: float, *names: str) -> None:
        """Lose lines, and poll the others meanwhile."""
        self.lose(*names)
        end_s = self.now_s + duration_s
        while self.now_s < end_s:
            self.poll(without=names)


class Scale(Gauge):
    def __init__(self, shop: Shop, name: str) -> None:
        super().__init__(GaugeOptions(driver="test", line=name))
        self._shop, self._name = shop, name

    @property
    def channels(self) -> Sequence[Channel]:
        return [Channel("value")]

    def read(self, line: object) -> Sequence[Reading]:
        return [self._shop.ask(self._name)]


@pytest.fixture
def shop() -> Shop:
    shop = Shop()
    shop.poll(20)
    assert all(shop.reading(name).ok for name in GAUGES)
    return shop


def driven(start_s: float, way_mm: float, speed: float = 50.0, acceleration: float = 250.0) -> Callable[[float], float]:
    """A position over time: from 0 to `way_mm`, with a trapezoidal speed, from `start_s` on."""
    ramp_s = min(speed / acceleration, math.sqrt(abs(way_mm) / acceleration))
    duration_s = ramp_s + abs(way_mm) / (acceleration * ramp_s)

    def position_mm(time_s: float) -> float:
        t = min(max(time_s - start_s, 0.0), duration_s)
        if t < ramp_s:
            way = acceleration * t**2 / 2
        elif t > duration_s - ramp_s:
            way = abs(way_mm) - acceleration * (duration_s - t) ** 2 / 2
        else:
            way = acceleration * ramp_s * (t - ramp_s / 2)
        return math.copysign(way, way_mm)

    return position_mm


@pytest.mark.parametrize("error_mm", [0.002, 0.05, -1.0, 700.0])
def test_one_damaged_reading_is_never_published(shop, error_mm):
    shop.damage["scale_1"] = [error_mm]
    for _ in range(5):
        shop.poll()
        assert shop.reading("scale_1").value == pytest.approx(0.0, abs=0.001)
    assert shop.gauges["scale_1"].quality is Quality.OK


def test_two_damaged_readings_that_disagree_leave_the_last_good_one(shop):
    before = shop.reading("scale_1")
    shop.damage["scale_1"] = [1.0, -3.0]
    shop.poll()
    assert pack(shop.reading("scale_1")) == pack(before)
    assert shop.gauges["scale_1"].quality is Quality.MISMATCH
    shop.poll()
    assert shop.gauges["scale_1"].quality is Quality.OK


@pytest.mark.parametrize("jump_mm", [0.5, 1.0, -5.0])
def test_a_jump_that_the_next_answer_confirms_is_not_believed_until_a_person_accepts_it(shop, jump_mm):
    shop.shows["scale_1"] = lambda _: jump_mm
    shop.poll(10)
    reading = shop.reading("scale_1")
    assert reading.quality is Quality.DISTRUSTED
    assert f"jumped by {jump_mm:.3f} mm" in reading.detail
    assert "`compd accept scale_1`" in reading.detail
    assert "limited by `fastest_mm_per_s: 60`, `acceleration_mm_per_s2: 400`" in reading.detail
    shop.shows["scale_1"] = lambda _: 0.0
    shop.poll(10)
    assert shop.reading("scale_1").quality is Quality.DISTRUSTED, "not by itself"
    assert shop.memory.accept("scale_1") == ["scale_1.value"]
    shop.poll()
    assert shop.reading("scale_1").ok


def test_a_limit_of_speed_that_is_too_small_is_named_in_the_fault():
    """A scale that moves faster than a comparator, for which the key was written."""
    shop = Shop(MotionLimits(speed=0.5))
    shop.poll(5)
    start_s = shop.now_s
    shop.shows["scale_1"] = lambda time_s: 10.0 * (time_s - start_s)
    shop.poll(5)
    assert "its motion is limited by `fastest_mm_per_s: 0.5`" in shop.gauges["scale_1"].detail


def test_without_limits_a_scale_is_followed_at_every_speed():
    shop = Shop(MotionLimits())
    shop.poll(5)
    start_s = shop.now_s
    shop.shows["scale_1"] = lambda time_s: 10.0 * (time_s - start_s)
    for _ in range(20):
        shop.poll()
        assert shop.reading("scale_1").ok


@pytest.mark.parametrize("driver", names(GAUGES_GROUP))
def test_no_driver_limits_the_speed_of_what_it_measures_by_default(driver):
    assert load(GAUGES_GROUP, driver, driver).Options.model_fields["fastest_mm_per_s"].default is None


def test_without_limits_a_jump_that_two_answers_agree_on_is_believed():
    shop = Shop(MotionLimits())
    shop.poll(20)
    shop.shows["scale_1"] = lambda _: 1.0
    shop.poll()
    assert shop.reading("scale_1").value == pytest.approx(1.0, abs=0.001)


@pytest.mark.parametrize("way_mm", [0.01, 0.3, -20.0])
@pytest.mark.parametrize("poll_s", [0.0005, 0.005, 0.05])
def test_a_machine_that_drives_is_believed_all_the_way(way_mm, poll_s, monkeypatch):
    monkeypatch.setattr(f"{__name__}.POLL_S", poll_s)
    shop = Shop()
    shop.poll(20)
    shop.shows["scale_1"] = position = driven(shop.now_s + 0.01, way_mm)
    end_s = shop.now_s + 3.0
    while shop.now_s < end_s:
        shop.poll()
        reading = shop.reading("scale_1")
        assert reading.ok, reading
        assert reading.value == pytest.approx(position(reading.time_s), abs=0.001)
        assert shop.now_s - reading.time_s < 2 * (poll_s + 6 * REPLY_S)
    assert shop.asked["scale_1"] < 1.5 * shop.gauges["scale_1"].polls + 10


WAYS_MM = {"scale_1": 20.0, "scale_2": 14.0, "scale_3": -9.0}


def driven_with_a_gap(shop: Shop, begins_s: float, lost_s: float, lost_mm: float, alone: bool = False) -> None:
    """A move; `begins_s` after its start scale_1 is silent for `lost_s`, and has lost `lost_mm` when it is back."""
    start_s = shop.now_s
    for name, way_mm in WAYS_MM.items():
        if name == "scale_1" or not alone:
            shop.shows[name] = driven(start_s, way_mm, speed=2.5 * abs(way_mm), acceleration=12.5 * abs(way_mm))
    while shop.now_s < start_s + begins_s:
        shop.poll()
    move = shop.shows["scale_1"]
    end_s = shop.now_s + lost_s
    shop.shows["scale_1"] = lambda time_s: move(time_s) + lost_mm
    while shop.now_s < end_s:
        shop.damage["scale_1"] = [LineFault(Quality.TIMEOUT)]
        shop.poll()
    shop.damage["scale_1"] = []
    shop.poll(60)


# in the move's beginning, in its middle, over its end
@pytest.mark.parametrize("begins_s", [0.1, 0.25, 0.45])
@pytest.mark.parametrize("lost_s", [0.05, 0.15, 0.4])
def test_a_gap_in_a_move_of_the_machine_is_no_jump(shop, begins_s, lost_s):
    driven_with_a_gap(shop, begins_s, lost_s, 0.0)
    reading = shop.reading("scale_1")
    assert reading.ok, reading
    assert reading.value == pytest.approx(shop.shows["scale_1"](reading.time_s), abs=1e-3)


@pytest.mark.parametrize("begins_s", [0.1, 0.25, 0.45])
@pytest.mark.parametrize("lost_s", [0.15, 0.4])
def test_a_scale_that_has_lost_its_count_in_a_gap_of_a_move_is_not_believed(shop, begins_s, lost_s):
    """In 0.4 s its acceleration would allow 16 mm."""
    driven_with_a_gap(shop, begins_s, lost_s, -5.0)
    assert shop.reading("scale_1").quality is Quality.DISTRUSTED


def test_a_link_that_is_jogged_alone_is_followed_over_a_gap_by_its_own_speed(shop):
    driven_with_a_gap(shop, 0.25, 0.11, 0.0, alone=True)
    assert shop.reading("scale_1").ok


def test_a_link_that_is_jogged_alone_and_loses_its_count_in_a_gap_is_not_believed(shop):
    driven_with_a_gap(shop, 0.25, 0.11, -2.0, alone=True)
    assert "came back -" in shop.reading("scale_1").detail


@pytest.mark.parametrize("gone_s", [0.2, 0.3, 1.0])
@pytest.mark.parametrize("is_replaced", [True, False])
def test_a_daemon_that_was_silent_itself_follows_a_machine_on_the_move(shop, gone_s, is_replaced):
    """No poll has failed: the limits of motion judge what every gauge shows then, and all are believed at once."""
    start_s = shop.now_s
    for name, way_mm in WAYS_MM.items():
        shop.shows[name] = driven(start_s, 4 * way_mm, speed=2.5 * abs(way_mm), acceleration=12.5 * abs(way_mm))
    while shop.now_s < start_s + 0.25:
        shop.poll()
    shop.now_s += gone_s
    if is_replaced:
        shop.start_acquisition()
    shop.poll(2)
    assert all(shop.reading(name).ok and shop.reading(name).time_s > shop.now_s - 0.1 for name in GAUGES)


@pytest.mark.parametrize("lost_mm", [400.0, -900.0])
def test_after_its_own_silence_the_daemon_believes_no_count_that_the_limits_of_motion_exclude(shop, lost_mm):
    start_s = shop.now_s
    for name, way_mm in WAYS_MM.items():
        shop.shows[name] = driven(start_s, way_mm)
    while shop.now_s < start_s + 0.25:
        shop.poll()
    shop.now_s += 1.0
    move = shop.shows["scale_1"]
    shop.shows["scale_1"] = lambda time_s: move(time_s) + lost_mm
    shop.poll(2)
    assert shop.reading("scale_1").quality is Quality.DISTRUSTED


@pytest.mark.parametrize("shows_mm", [0.0, 3.0])
def test_a_scale_at_zero_that_may_have_been_without_power_is_asked_for(shop, shows_mm):
    """It would show zero with any direction and unit; at another place it would show another value."""
    drive(shop, scale_1=shows_mm)
    shop.away_s(2.0, "scale_1")
    shop.poll(20)
    if shows_mm:
        assert shop.reading("scale_1").ok
        return
    assert "with any direction and unit" in shop.reading("scale_1").detail
    shop.memory.accept("scale_1")
    shop.poll(2)
    assert shop.reading("scale_1").ok


@pytest.mark.parametrize("away_mm", [5.0, -0.01])
def test_a_scale_that_comes_back_with_another_value_is_not_believed(shop, away_mm):
    shop.away_s(2.0, "scale_1")
    shop.shows["scale_1"] = lambda _: away_mm
    shop.poll(100)
    reading = shop.reading("scale_1")
    assert reading.quality is Quality.DISTRUSTED
    assert reading.detail == f"came back {away_mm:.3f} mm away: reference it, then `compd accept scale_1`"
    shop.memory.accept("scale_1")
    shop.poll()
    assert shop.reading("scale_1").value == pytest.approx(away_mm, abs=0.001)


def drive(shop: Shop, **ways_mm: float) -> None:
    """From zero to these places, and let the machine rest there."""
    for name, way_mm in ways_mm.items():
        shop.shows[name] = driven(shop.now_s, way_mm) if way_mm else lambda _: 0.0
    shop.poll(100)


def test_a_scale_that_comes_back_with_its_value_is_believed_where_nothing_has_moved(shop):
    drive(shop, scale_1=3.0)
    shop.away_s(2.0, "scale_1")
    shop.poll(2)
    assert shop.reading("scale_1").ok


def test_a_scale_that_comes_back_with_its_value_is_not_believed_where_another_one_has_moved(shop):
    shop.shows["scale_2"] = driven(shop.now_s, 3.0)
    shop.away_s(2.0, "scale_1")
    shop.poll(2)
    assert "scale_2 has moved meanwhile" in shop.reading("scale_1").detail


def test_silence_until_the_last_reading_is_stale_is_a_loss(shop):
    shop.damage["scale_1"] = [LineFault(Quality.TIMEOUT)] * int(2 * STALE_AFTER_S / POLL_S)
    shop.poll(int(2 * STALE_AFTER_S / POLL_S))
    shop.shows["scale_1"] = lambda _: 0.02
    shop.poll(2)
    assert "came back 0.020 mm away" in shop.reading("scale_1").detail


def test_a_gauge_that_moves_alone_in_a_short_silence_counts_anew(shop):
    """In 0.3 s its acceleration would allow 9 mm."""
    shop.damage["scale_1"] = [LineFault(Quality.TIMEOUT)] * int(0.3 / POLL_S)
    shop.poll(int(0.3 / POLL_S / 3))
    shop.damage["scale_1"] = []
    shop.shows["scale_1"] = lambda _: 5.0
    values = []
    for _ in range(50):
        shop.poll()
        values += [shop.reading("scale_1").value] if shop.reading("scale_1").ok else []
    assert max(values, default=0.0) < 0.001
    assert "came back 5.000 mm away" in shop.reading("scale_1").detail


def test_a_machine_that_begins_to_move_in_a_short_silence_is_followed(shop):
    begins_s = shop.now_s + 0.02
    for name, way_mm in zip(GAUGES, (40.0, 30.0, -20.0), strict=True):
        shop.shows[name] = driven(begins_s, way_mm)
    shop.damage["scale_1"] = [LineFault(Quality.TIMEOUT)] * 8
    shop.poll(60)
    assert shop.reading("scale_1").ok
    assert shop.reading("scale_1").value == pytest.approx(
        shop.shows["scale_1"](shop.reading("scale_1").time_s), abs=1e-3
    )


def test_a_gauge_that_is_accepted_between_a_poll_and_its_judgement_is_believed_at_the_next(shop):
    """Readings may wait until their line is known to be in step."""
    shop.poll(20)
    shop.shows["scale_1"] = lambda _: 5.0
    shop.poll(2)
    assert shop.reading("scale_1").quality is Quality.DISTRUSTED
    gauge = shop.gauges["scale_1"]
    readings = gauge.read(None)
    shop.memory.accept("scale_1")
    gauge.put(readings, shop.now_s)
    shop.poll()
    assert shop.reading("scale_1").ok


@pytest.mark.parametrize("comes_back_mm", [0.0, 5.0], ids=["at zero", "elsewhere"])
@pytest.mark.parametrize("doubted", [False, True], ids=["believed", "distrusted"])
def test_an_order_that_is_older_than_a_loss_says_nothing_of_what_comes_back(shop, doubted, comes_back_mm):
    shop.poll(20)
    if doubted:
        shop.shows["scale_1"] = lambda _: 2.0
        shop.poll(2)
    shop.memory.accept("scale_1")
    shop.away_s(2.0, "scale_1")
    shop.shows["scale_1"] = lambda _: comes_back_mm
    shop.poll(20)
    assert shop.reading("scale_1").quality is Quality.DISTRUSTED
    shop.memory.accept("scale_1")
    shop.poll(2)
    assert shop.reading("scale_1").ok


def test_an_order_waits_until_two_answers_agree(shop):
    """It shakes while the person accepts it, and is believed when it stands."""
    shop.poll(20)
    shop.shows["scale_1"] = lambda time_s: 5.0 + 0.2 * math.sin(900.0 * time_s)
    shop.poll(2)
    shop.memory.accept("scale_1")
    shop.poll(2)
    i = shop.memory.index["scale_1.value"]
    assert shop.memory.obeyed[i] < shop.memory.accepted[i]
    shop.shows["scale_1"] = lambda _: 5.0
    shop.poll(2)
    assert shop.reading("scale_1").ok


def test_an_absolute_gauge_needs_no_acceptance():
    shop = Shop(returns_by_itself=True)
    shop.poll(20)
    shop.away_s(2.0, "scale_1")
    shop.shows["scale_1"] = lambda _: 0.03
    shop.poll(2)
    assert shop.reading("scale_1").value == pytest.approx(0.03, abs=0.001)


@pytest.mark.parametrize("silent", ["the lines are lost", "polls fail"])
def test_where_all_scales_were_away_old_counts_are_no_proof_that_nothing_has_moved(shop, silent):
    """The machine may have been moved while nobody saw it, and displays that lost their power may show their old
    counts."""
    drive(shop, scale_1=3.0, scale_2=2.0, scale_3=1.0)
    if silent == "polls fail":
        for _ in range(80):
            shop.damage |= {name: [LineFault(Quality.TIMEOUT)] for name in GAUGES}
            shop.poll()
    else:
        shop.away_s(2.0, *GAUGES)
    shop.poll(5)
    for name in GAUGES:
        assert shop.reading(name).quality is Quality.DISTRUSTED
        assert "all scales were away" in shop.reading(name).detail
    shop.memory.accept("all")
    shop.poll(3)
    assert all(shop.reading(name).ok for name in GAUGES)


def test_what_is_not_believed_outlives_the_process_that_polls(shop):
    shop.away_s(2.0, "scale_1")
    shop.shows["scale_1"] = lambda _: 5.0
    shop.poll(2)
    shop.start_acquisition()
    shop.poll(2)
    assert "came back 5.000 mm away" in shop.reading("scale_1").detail


@pytest.mark.parametrize("gone_s", [0.2, 1.0, 30.0])
def test_after_a_process_that_was_not_there_a_gauge_that_shows_what_it_showed_is_believed(shop, gone_s):
    shop.now_s += gone_s
    shop.start_acquisition()
    shop.poll(3)
    assert all(shop.reading(name).ok for name in GAUGES)
    assert shop.reading("scale_1").time_s > shop.now_s - 0.1


@pytest.mark.parametrize("gone_s", [0.2, 1.0, 30.0])
@pytest.mark.parametrize("away_mm", [0.03, -0.2, -5.0])
def test_after_a_process_that_was_not_there_a_gauge_that_alone_shows_another_value_is_not_believed(
    shop, gone_s, away_mm
):
    shop.now_s += gone_s
    shop.shows["scale_1"] = lambda _: away_mm
    shop.start_acquisition()
    shop.poll(60)
    assert shop.reading("scale_1").quality is Quality.DISTRUSTED
    assert all(shop.reading(name).ok for name in GAUGES[1:])


def test_a_vote_is_heard_and_an_unknown_name_is_refused(shop):
    shop.memory.vote({"scale_2.value": "scale_2 stands while all others move"})
    shop.poll()
    assert "stands while all others move: look at it, then `compd accept scale_2`" in shop.reading("scale_2").detail
    with pytest.raises(ValueError, match="allowed: all, scale_1"):
        shop.memory.accept("scale_7")
    assert shop.memory.accept("all") == ["scale_2.value"]
    shop.poll()
    assert shop.reading("scale_2").ok


def test_the_jump_that_can_be_feigned_is_what_is_told(shop):
    told_mm = unseen_jump_mm(LIMITS, POLL_S + 3 * REPLY_S, tolerance_mm(NOISE_UM))
    shop.shows["scale_1"] = lambda _: 1.2 * told_mm
    shop.poll(3)
    assert shop.reading("scale_1").quality is Quality.DISTRUSTED
