"""Faults of a gauge in all, and in the last hour."""

from __future__ import annotations

from compd.page.broadcast import FaultCounts


def status(**counts):
    gauges = {name: {"faults": {"timeout": count}} for name, count in counts.items()}
    return {"lines": {"a": {"gauges": gauges}, "b": {"gauges": {"room": {"faults": {}}}}}}


def test_before_an_hour_it_counts_from_when_the_page_has_seen_it():
    counts = FaultCounts()
    assert counts.summary() is None
    counts.note(1000.0, status(scale_1=7))
    counts.note(1300.0, status(scale_1=9))
    assert counts.summary() == {
        "since_s": 1000.0,
        "hour": False,
        "total": {"scale_1": 9, "room": 0},
        "recent": {"scale_1": 2, "room": 0},
    }


def test_then_of_the_last_hour():
    counts = FaultCounts()
    for second in range(3 * 3600):
        counts.note(float(second), status(scale_1=second // 10))
    answer = counts.summary()
    assert answer["hour"]
    assert answer["total"]["scale_1"] == 1079
    assert 360 <= answer["recent"]["scale_1"] <= 366
    assert 3540.0 <= 3 * 3600 - answer["since_s"] <= 3660.0


def test_a_daemon_that_has_started_anew_begins_at_nothing():
    counts = FaultCounts()
    counts.note(1000.0, status(scale_1=7))
    counts.note(2000.0, status(scale_1=1))
    counts.note(2001.0, status(scale_1=3))
    assert counts.summary()["since_s"] == 2000.0
    assert counts.summary()["recent"]["scale_1"] == 2
