"""The past as a whole: which events are kept, and which is found."""

from __future__ import annotations

import json
import random

import pytest

from compd.page.broadcast import Moments


def noted(seconds, step_s=0.1):
    moments = Moments()
    for k in range(round(seconds / step_s)):
        time_s = 1000.0 + k * step_s
        moments.note(time_s, json.dumps({"unix_s": time_s}).encode())
    return moments, time_s


def found(moments, time_s):
    return json.loads(moments.nearest(time_s))["unix_s"]


def test_the_last_minute_is_kept_by_tenths_and_the_hour_by_seconds():
    moments, end_s = noted(4000.0)
    for back_s in (0.0, 0.1, 12.3, 59.8):
        assert abs(found(moments, end_s - back_s) - (end_s - back_s)) < 0.06
    for back_s in (70.4, 1800.7, 3598.9):
        assert abs(found(moments, end_s - back_s) - (end_s - back_s)) < 0.51
    assert found(moments, 0.0) > end_s - 3601.0, "the oldest that is kept"
    assert found(moments, 1e12) == end_s


def test_before_the_first_there_is_none():
    assert Moments().nearest(1000.0) is None


@pytest.mark.long
def test_what_is_kept_does_not_grow_after_an_hour():
    moments, sizes = Moments(), []
    for second in range(3 * 3600):
        moments.note(float(second), json.dumps([random.random() for _ in range(100)]).encode())
        if second % 3600 == 3599:
            sizes.append(sum(len(event) for kept in moments._kept for event in kept.events))
    assert sizes[2] < 1.01 * sizes[0]
