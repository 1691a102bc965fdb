"""OPC UA from a real server to the slots of the readings: status codes, times, and a server that goes and comes."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from asyncua import ua

from compd.clock import Clock
from compd.gauge import Gauge, Quality
from compd.source_time import SAME_TIME_S
from tests.support.hand_clock import SteppedClock
from tests.support.opc_ua_server import NAMESPACE, OneUser, OpcUaServer, running_server
from tests.support.pushed_gauges import STALE_AFTER_S, acquiring, gauge

OK = Quality.OK
# Of a line that is not lost when the clock is put forward.
PATIENT_LINE_S = 4 * STALE_AFTER_S
# Part 4, 7.39: the low half says something of a value; at its high limit.
OF_A_VALUE, AT_HIGH = 0x0400, 0x0200


@pytest.fixture(scope="module")
def server() -> Iterator[OpcUaServer]:
    with running_server() as started:
        yield started


def line_to(server: OpcUaServer, **keys: Any) -> dict[str, Any]:
    return {"kind": "opc_ua", "endpoint": server.endpoint, "publishing_s": 0.02, **keys}


def probe(node: str = "ns=2;s=a", time_from: str = "source", **keys: Any) -> Gauge[Any]:
    return gauge("opc_ua", time_from=time_from, channels=[{"name": "a", "node": node, "unit": "mm", **keys}])


@contextmanager
def listening(
    server: OpcUaServer,
    measured: Gauge[Any],
    node: str = "a",
    first: tuple[Any, ua.VariantType | None] = (0.0, None),
    clock: Clock | None = None,
    **keys: Any,
) -> Iterator[tuple[Any, Any]]:
    """The line's thread with one gauge, subscribed: it has heard what the server had before, which is too old."""
    server.write(node, *first, age_s=3600)
    with acquiring(line_to(server, **keys), {"g": measured}, clock=clock) as (acquisition, latest):
        latest.wait_for_any("g.a")
        yield acquisition, latest


def test_a_number_is_read_in_its_unit_with_the_time_of_its_source(server: OpcUaServer) -> None:
    with listening(server, probe(unit="um")) as (_, latest):
        since, before_s, age_s = latest.now, time.monotonic(), STALE_AFTER_S / 2
        server.write("a", 12.5, age_s=age_s)
        reading = latest.wait_for("g.a", OK, since)
        assert reading.value == pytest.approx(0.0125)
        # older where the line's thread is held up between two looks at its clocks
        assert before_s - STALE_AFTER_S < reading.time_s <= time.monotonic() - age_s + SAME_TIME_S


@pytest.mark.parametrize("kind", ["Float", "Int16", "UInt64", "Byte"])
def test_every_kind_of_number(server: OpcUaServer, kind: str) -> None:
    numbers = (7, ua.VariantType[kind])
    with listening(server, probe(f"ns=2;s={kind}"), node=kind, first=numbers) as (_, latest):
        server.write(kind, *numbers)
        assert latest.wait_for("g.a", OK).value == 7.0


def test_an_entry_of_an_array(server: OpcUaServer) -> None:
    with listening(server, probe(index=1)) as (_, latest):
        server.write("a", [1.0, 2.0], ua.VariantType.Double)
        assert latest.wait_for("g.a", OK).value == 2.0
        server.write("a", [1.0], ua.VariantType.Double)
        latest.wait_for("g.a", Quality.MISMATCH)


@pytest.mark.parametrize(
    ("value", "kind", "quality"),
    [
        ("1.5", "String", Quality.MISMATCH),
        (True, "Boolean", Quality.MISMATCH),
        ([1.5], "Double", Quality.MISMATCH),
        (b"1.5", "ByteString", Quality.MISMATCH),
        (math.nan, "Double", Quality.NOT_FINITE),
        (-math.inf, "Float", Quality.NOT_FINITE),
    ],
)
def test_what_is_no_number_has_a_name_and_no_value(
    server: OpcUaServer, value: Any, kind: str, quality: Quality
) -> None:
    node = f"no number {kind}"
    with listening(server, probe(f"ns=2;s={node}"), node=node, first=(value, ua.VariantType[kind])) as (_, latest):
        since = latest.now
        server.write(node, value, ua.VariantType[kind])
        assert math.isnan(latest.wait_for("g.a", quality, since).value)


@pytest.mark.parametrize(
    ("status", "quality", "detail"),
    [
        (ua.StatusCodes.BadSensorFailure, Quality.SENSOR_FAULT, "BadSensorFailure"),
        (ua.StatusCodes.BadNoCommunication, Quality.DEVICE_ERROR, "BadNoCommunication"),
        (ua.StatusCodes.BadOutOfService, Quality.DEVICE_ERROR, "BadOutOfService"),
        (ua.StatusCodes.UncertainLastUsableValue, Quality.STALE, "UncertainLastUsableValue"),
        (ua.StatusCodes.UncertainSensorNotAccurate, Quality.SENSOR_FAULT, "UncertainSensorNotAccurate"),
        (ua.StatusCodes.Uncertain, Quality.DEVICE_ERROR, "Uncertain"),
        (ua.StatusCodes.GoodLocalOverride, Quality.SENSOR_FAULT, "GoodLocalOverride"),
        (ua.StatusCodes.Good | OF_A_VALUE | AT_HIGH, Quality.OVER_RANGE, "Good, at its high limit"),
        (0xC0000000, Quality.DEVICE_ERROR, ""),
    ],
)
def test_a_status_that_is_not_good_has_no_value_but_its_name(
    server: OpcUaServer, status: int, quality: Quality, detail: str
) -> None:
    with listening(server, probe()) as (_, latest):
        since = latest.now
        server.write("a", 1.5, status=status)
        reading = latest.wait_for("g.a", quality, since)
        assert math.isnan(reading.value)
        assert detail in reading.detail
        since = latest.now
        server.write("a", 1.6)
        assert latest.wait_for("g.a", OK, since).value == 1.6


def test_an_old_value_is_stale_and_a_future_one_has_the_time_of_its_request(server: OpcUaServer) -> None:
    server.write("a", 1.5, age_s=3600)
    with acquiring(line_to(server), {"g": probe()}) as (_, latest):
        assert "measured 3.6e+03 s ago" in latest.wait_for("g.a", Quality.STALE).detail
        before_s = time.monotonic()
        server.write("a", 1.6, age_s=-3600)
        reading = latest.wait_for("g.a", OK)
        assert before_s - STALE_AFTER_S < reading.time_s <= time.monotonic()


def test_a_value_that_is_written_again_is_new_and_one_that_is_not_grows_stale(server: OpcUaServer) -> None:
    clock = SteppedClock()
    with listening(server, probe(), clock=clock, timeout_s=PATIENT_LINE_S) as (acquisition, latest):
        server.write("a", 1.5)
        latest.wait_for("g.a", OK)
        since = latest.now
        server.write("a", 1.5)
        latest.wait_for("g.a", OK, since)
        clock.step(1.01 * STALE_AFTER_S)
        reading = latest.wait_for("g.a", Quality.TIMEOUT)  # its writer has died; keep-alives go on
        assert "`unchanged: holds`" in reading.detail
        assert acquisition.status()["l"]["state"] == "open"


def test_a_value_that_stands_still_is_confirmed_where_the_server_sends_only_changes(server: OpcUaServer) -> None:
    server.write("a", 1.5, age_s=3600)
    clock = SteppedClock()
    line = line_to(server, unchanged="holds", timeout_s=PATIENT_LINE_S)
    with acquiring(line, {"g": probe()}, clock=clock) as (_, latest):
        first = latest.wait_for("g.a", OK)
        later_s = first.time_s + 2 * STALE_AFTER_S
        while (reading := latest.wait_for("g.a", OK, latest.now)).time_s < later_s:
            assert reading.value == 1.5
            assert reading.time_s <= clock.monotonic()
            clock.step(STALE_AFTER_S / 4)
        assert {r.quality for _, r in latest.history} == {OK}
        server.write("a", 1.5, status=ua.StatusCodes.BadSensorFailure)
        latest.wait_for("g.a", Quality.SENSOR_FAULT)


def test_by_arrival_the_time_is_that_of_the_request(server: OpcUaServer) -> None:
    server.write("a", 1.5, age_s=None)
    with acquiring(line_to(server), {"g": probe(time_from="arrival")}) as (_, latest):
        assert "nobody knows how old" in latest.wait_for("g.a", Quality.STALE).detail
        before_s = time.monotonic()
        server.write("a", 1.6, age_s=7200)
        reading = latest.wait_for("g.a", OK)
        assert before_s - STALE_AFTER_S < reading.time_s < time.monotonic()


def test_out_of_order_values_change_nothing(server: OpcUaServer) -> None:
    with listening(server, probe()) as (acquisition, latest):
        server.write("a", 1.5, age_s=0.05)
        latest.wait_for_value("g.a", 1.5)
        server.write("b", 0.0)
        server.write("a", 99.0, age_s=5.0)
        polls = acquisition.status()["l"]["gauges"]["g"]["polls"]
        while acquisition.status()["l"]["gauges"]["g"]["polls"] == polls:
            server.write("b", 0.0)  # until the late one is heard
        server.write("a", 1.7)
        latest.wait_for_value("g.a", 1.7)
        assert {r.value for _, r in latest.history if r.ok} == {1.5, 1.7}
        assert acquisition.status()["l"]["gauges"]["g"]["faults"]["mismatch"] == 1


def test_a_node_that_is_missing_is_named_and_the_others_go_on(server: OpcUaServer) -> None:
    server.write("a", 1.5)
    gauges = {
        "g": probe(),
        "h": probe("ns=2;s=absent"),
        "i": probe("nsu=http://nobody/;s=a"),
        "j": probe("i=99999999999"),
    }
    with acquiring(line_to(server), gauges) as (_, latest):
        assert latest.wait_for("g.a", OK).value == 1.5
        assert "BadNodeIdUnknown" in latest.wait_for("h.a", Quality.DEVICE_ERROR).detail
        assert "no namespace http://nobody/" in latest.wait_for("i.a", Quality.DEVICE_ERROR).detail
        latest.wait_for("j.a", Quality.DEVICE_ERROR)


def test_a_node_that_comes_later_is_read(server: OpcUaServer) -> None:
    with acquiring(line_to(server), {"g": probe("ns=2;s=later")}) as (_, latest):
        latest.wait_for("g.a", Quality.DEVICE_ERROR)
        server.write("later", 1.5)
        assert latest.wait_for("g.a", OK).value == 1.5


def test_a_node_by_the_name_of_its_namespace(server: OpcUaServer) -> None:
    server.write("a", 1.5)
    with acquiring(line_to(server), {"g": probe(f"nsu={NAMESPACE};s=a")}) as (_, latest):
        assert latest.wait_for("g.a", OK).value == 1.5


def test_a_server_that_is_restarted_is_a_lost_line_until_it_is_back(server: OpcUaServer) -> None:
    with listening(server, probe()) as (acquisition, latest):
        server.write("a", 1.5)
        latest.wait_for("g.a", OK)
        since = latest.now
        server.stop()
        assert math.isnan(latest.wait_for("g.a", Quality.LINE_LOST, since).value)
        server.start()
        server.write("a", 1.6)
        assert latest.wait_for_value("g.a", 1.6, since).ok
        status = acquisition.status()["l"]
        assert (status["state"], status["lost"]) == ("open", 1)


def test_a_server_that_stands_still_is_lost_though_its_connection_is_open(server: OpcUaServer) -> None:
    with listening(server, probe(), timeout_s=1.0) as (_, latest):
        server.write("a", 1.5)
        latest.wait_for("g.a", OK)
        since = latest.now
        server.pause()
        reading = latest.wait_for("g.a", Quality.LINE_LOST, since)
        assert "subscription" in reading.detail or "connection" in reading.detail
        server.go_on()
        server.write("a", 1.6)
        latest.wait_for_value("g.a", 1.6)


@pytest.mark.long
@pytest.mark.sample
def test_user_and_password_out_of_a_file(tmp_path: Path) -> None:
    secret = tmp_path / "secret"
    secret.write_text("open sesame\n")
    login = {"user": "compd", "password_file": str(secret)}
    with running_server(OneUser()) as guarded:
        guarded.write("a", 1.5)
        with acquiring(line_to(guarded), {"g": probe()}) as (_, latest):
            assert "refuses: Bad" in latest.wait_for("g.a", Quality.LINE_LOST).detail
        with acquiring(line_to(guarded, **login), {"g": probe()}) as (_, latest):
            assert latest.wait_for("g.a", OK).value == 1.5
        with acquiring(line_to(guarded, **{**login, "password_file": "/nowhere"}), {"g": probe()}) as (_, latest):
            assert "No such file" in latest.wait_for("g.a", Quality.LINE_LOST).detail
