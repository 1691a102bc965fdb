"""The interface of drivers: the example in its documentation works; a reading has a value or says why not."""

from __future__ import annotations

import math
import re
import textwrap

import pytest

import compd.gauge
from compd.gauge import Channel, GaugeOptions, LineFault, Quality, bad, good


class Replies:
    """A `ByteLine` whose device gives one reply."""

    def __init__(self, reply):
        self.reply = reply

    def send(self, request):
        assert request == b"?\r"
        return 12.5

    def receive_until(self, terminator, limit):
        assert self.reply.endswith(terminator)
        assert len(self.reply) <= limit
        return self.reply


def documented_driver():
    """The class that the documentation of compd.gauge shows."""
    text = compd.gauge.__doc__
    code = text[text.index("    import re") : text.index("Rules for every driver")]
    names = {}
    exec(textwrap.dedent(code), names)
    return names["MyGauge"](GaugeOptions(driver="my_gauge", line="here"))


def test_the_documented_driver_reads_its_gauge():
    gauge = documented_driver()
    assert list(gauge.channels) == [Channel("value", "mm")]
    assert gauge.read(Replies(b"+01.2345\r\n")) == [good(1.2345, 12.5)]
    (over,) = gauge.read(Replies(b"OVER\r\n"))
    assert (over.quality, over.detail, over.time_s) == (Quality.OVER_RANGE, "OVER", 12.5)
    with pytest.raises(LineFault) as caught:
        gauge.read(Replies(b"+01.23\r\n"))
    assert caught.value.quality is Quality.MISMATCH


def test_a_driver_can_import_all_that_its_methods_take_and_give():
    """Every class that the annotations of `Gauge` name and this module defines is in `__all__`."""
    named = set()
    for member in vars(compd.gauge.Gauge).values():
        function = member.fget if isinstance(member, property) else member
        named |= set(re.findall(r"\w+", " ".join(map(str, getattr(function, "__annotations__", {}).values()))))
    classes = {name for name, value in vars(compd.gauge).items() if isinstance(value, type)}
    defined = {name for name in named & classes if vars(compd.gauge)[name].__module__ == "compd.gauge"}
    assert "DataSheetNoise" in defined
    assert defined <= set(compd.gauge.__all__)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_value_that_is_not_finite_is_no_good_reading(value):
    reading = good(value, 1.0)
    assert reading.quality is Quality.NOT_FINITE
    assert reading.detail == repr(value)
    assert math.isnan(reading.value)


def test_a_bad_reading_has_no_value_and_says_why():
    reading = bad(2.0, Quality.CRC, "damaged")
    assert not reading.ok
    assert math.isnan(reading.value)
    assert (reading.time_s, reading.detail) == (2.0, "damaged")
