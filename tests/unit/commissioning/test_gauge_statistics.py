"""What is counted over the polls of one gauge."""

from __future__ import annotations

import math

import pytest

from compd.gauge import Channel, Quality, bad, good
from compd.gauge_tools import GaugeStatistics


def test_statistics() -> None:
    statistics = GaugeStatistics([Channel("a"), Channel("b")])
    assert math.isnan(statistics.rate_hz)
    assert math.isnan(statistics.noise(0))
    for k in range(5):
        other = bad(k / 10, Quality.CRC) if k % 2 else good(1.0, k / 10)
        statistics.add([good(0.001 * k, k / 10), other], k / 10)
    assert statistics.rate_hz == pytest.approx(10)
    assert statistics.noise(0) == pytest.approx(0.001 * math.sqrt(2.5))
    assert statistics.noise(1) == 0
    assert statistics.faults == {Quality.CRC: 2}
    assert statistics.age_s(1, 0.5) == pytest.approx(0.1)
