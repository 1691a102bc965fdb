"""A described gauge with a request for each of its values."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

from compd.conformance import driver_under_test, run_conformance
from compd.gauge import LineFault, Quality
from compd_drivers.simulated.serial_ascii import SimulatedAscii
from tests.support.ascii_gauge import gauge, line_with

PROBES: dict[str, Any] = {
    "out": "",
    "requests": [{"out": f"M{k}", "in": f"%(p{k})+08.4f"} for k in (1, 2, 3)],
    "channels": [{"name": f"p{k}", "unit": "mm"} for k in (3, 1, 2)],
    "errors": [{"in": "ERR%*1d", "quality": "sensor_fault"}],
}


def test_each_value_has_its_own_request_and_time() -> None:
    device = gauge(**PROBES)
    values = {"p1": 1.0, "p2": -2.0, "p3": 3.5}
    far_end = SimulatedAscii(device.options, values.__getitem__)
    line, port = line_with(device=far_end.receive)
    readings = device.read(line)
    assert [reading.value for reading in readings] == [3.5, 1.0, -2.0], "in the order of the channels"
    assert port.written == [b"M1\r", b"M2\r", b"M3\r"]
    p3, p1, p2 = (reading.time_s for reading in readings)
    assert p1 < p2 < p3
    assert device.traffic() == [(3, 10)] * 3


def test_an_error_to_one_request_leaves_the_others_their_values() -> None:
    answers = {b"M1\r": b"+01.0000\r\n", b"M2\r": b"ERR0\r\n", b"M3\r": b"+03.0000\r\n"}
    line, _ = line_with(device=answers.__getitem__)
    readings = gauge(**PROBES).read(line)
    assert [reading.quality for reading in readings] == [Quality.OK, Quality.OK, Quality.SENSOR_FAULT]


def test_a_reply_to_another_request_is_no_value_where_replies_say_whose_they_are() -> None:
    named = [{"out": f"M{k}", "in": f"{k}:%(p{k})+08.4f"} for k in (1, 2, 3)]
    device = gauge(**{**PROBES, "requests": named})
    line, _ = line_with(device=lambda request: b"1:+01.0000\r\n")
    with pytest.raises(LineFault) as caught:
        device.read(line)
    assert caught.value.quality is Quality.MISMATCH


def test_what_all_replies_begin_with_is_whose_they_are() -> None:
    unit_2 = [{"out": f"2M{k}", "in": f"2,{k}:%(p{k})+08.4f"} for k in (1, 2, 3)]
    assert gauge(**{**PROBES, "requests": unit_2}).reply_identity == "2,"
    assert gauge(**PROBES).reply_identity is None


@pytest.mark.parametrize(
    ("keys", "problem"),
    [
        ({"out": "?"}, "there is no `out`"),
        ({"in": "%(p1)f"}, "either `in` or `requests`"),
        ({"requests": []}, "either `in` or `requests`"),
        ({"requests": PROBES["requests"][:2]}, r"no %\(p3\)f"),
        ({"requests": [*PROBES["requests"], {"out": "M4", "in": "%(p1)f"}]}, "p1 is in several replies"),
        ({"requests": [{"out": "M1", "in": "%f"}]}, "without name|has no"),
    ],
)
def test_requests_that_cannot_be_are_refused(keys: dict[str, Any], problem: str) -> None:
    with pytest.raises(ValidationError, match=problem):
        gauge(**{**PROBES, **keys})


@pytest.mark.long
def test_several_requests_on_wires_that_go_wrong() -> None:
    options = {**PROBES, "out_terminator": r"\r", "in_terminator": r"\r\n"}
    results = list(run_conformance(driver_under_test("serial_ascii", options), on_real_wires=False))
    assert [result for _, result in results if result.verdict == "FAIL"] == []
