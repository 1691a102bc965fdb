"""What a driver hears of a device that speaks by itself, message by message: no broker, no server."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import count
from typing import Any

import pytest

from compd.gauge import Quality
from compd.pushed_gauge import Message
from compd.source_time import Arrival
from tests.support.pushed_gauges import gauge

UTC_S = 1.8e9  # of monotonic 0
PLAIN = gauge("mqtt", period_s=1.0, channels=[{"name": "a", "topic": "a", "unit": "mm"}])
DOCUMENT = {"name": "a", "topic": "a", "value": "/v", "time": "/t", "time_format": "unix_s", "unit": "mm"}
NODE = {"name": "a", "node": "ns=2;s=a", "unit": "mm"}


def heard(measured: Any, payloads: list[Any], source_utc_s: Iterator[float]) -> list[float]:
    """The values that count of payloads that come 0.5 s after each other; nan for a reason."""
    readings = []
    for number, (payload, utc_s) in enumerate(zip(payloads, source_utc_s, strict=False)):
        arrival = Arrival(100.0 + 0.5 * number, UTC_S + 100.0 + 0.5 * number)
        readings += measured.receive(Message(measured.addresses[0], payload, arrival, utc_s))
    return [each.reading.value for each in readings]


@pytest.mark.parametrize(
    ("measured", "payload", "utc_s"),
    [
        (PLAIN, b"1.5", math.nan),
        (
            gauge("mqtt", time_from="arrival", period_s=1.0, channels=[DOCUMENT]),
            b'{"v": 1.5, "t": 1800000000}',
            math.nan,
        ),
        (gauge("opc_ua", channels=[NODE]), 1.5, math.nan),
        (gauge("opc_ua", time_from="arrival", channels=[NODE]), 1.5, UTC_S),
    ],
    ids=["plain number", "time that does not count", "node without a time", "node by arrival"],
)
def test_a_value_at_rest_without_a_time_that_counts_is_new_each_time(measured: Any, payload: Any, utc_s: float) -> None:
    assert heard(measured, [payload] * 4, iter([utc_s] * 4)) == [1.5] * 4


def test_a_value_at_rest_with_a_new_time_is_new_and_with_the_same_time_a_copy() -> None:
    node = gauge("opc_ua", channels=[NODE])
    assert heard(node, [1.5] * 3, count(UTC_S + 100.0, 0.5)) == [1.5] * 3
    assert heard(gauge("opc_ua", channels=[NODE]), [1.5] * 3, iter([UTC_S + 100.0] * 3)) == [1.5]


def test_a_value_counts_again_when_its_status_is_good_again() -> None:
    node = gauge("opc_ua", channels=[NODE])
    good = Message("ns=2;s=a", 1.5, Arrival(100.0, UTC_S + 100.0), UTC_S + 99.9)
    assert [each.reading.value for each in node.receive(good)] == [1.5]
    bad = good._replace(quality=Quality.DEVICE_ERROR, detail="BadOutOfService")
    assert [each.reading.quality for each in node.receive(bad)] == [Quality.DEVICE_ERROR]
    again = node.receive(good._replace(arrival=Arrival(101.0, UTC_S + 101.0)))
    assert [(each.reading.value, each.reading.time_s) for each in again] == [(1.5, pytest.approx(99.9))]
