"""Every driver against its device's other end, on a real pty or TCP port, sound and broken."""

from __future__ import annotations

import math
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from compd.gauge import Quality
from compd.plugins import GAUGES, SIMULATED_GAUGES, names
from tests.support.sampled import sampled
from tests.support.watching import until
from tests.support.wire_rig import Outcome, Rig, outcome, polled_until, rig

NAN = math.nan
OK = Quality.OK


class Case(NamedTuple):
    """One way to wire one driver, and what its sensors see: display steps that every number here is whole in."""

    line: dict[str, Any]
    gauge: dict[str, Any]
    values: dict[str, float]
    step: float


def serial(baud: int, form: str) -> dict[str, Any]:
    return {"kind": "serial", "port": "x", "baud": baud, "format": form, "timeout_s": 0.15}


RTU = {"kind": "modbus_rtu", "port": "x", "baud": 115200, "format": "8E1", "timeout_s": 0.1}
TCP = {"kind": "tcp", "host": "x", "port": 1, "timeout_s": 0.15}
MAP = {
    "driver": "modbus",
    "unit": 3,
    "channels": [
        {"name": "u1", "function": 4, "address": 2, "type": "float32", "unit": "mm"},
        {
            "name": "u2",
            "function": 4,
            "address": 4,
            "type": "int32",
            "unit": "mm",
            "scale": 1e-4,
            "word_order": "low_first",
            "status": {"address": 6},
        },
        {
            "name": "room",
            "function": 3,
            "address": 9,
            "type": "int16",
            "unit": "degC",
            "scale": 0.01,
            "invalid": [-32768],
            "byte_order": "little",
        },
    ],
}
SEEN = {"u1": -1.25, "u2": 3.1416, "room": -20.32}
HEADS = {"1": 0.0125, "2": -0.3001, "3": 5.0}
ND28X = {"driver": "heidenhain_nd28x"}
DLRS1A = {"driver": "keyence_gt2_dlrs1a", "heads": 3}
CASES = {
    "heidenhain 38400": Case(serial(38400, "7E2"), ND28X, {"position": -123.4567}, 1e-4),
    "heidenhain inch": Case(serial(9600, "7E2"), {**ND28X, "unit": "inch"}, {"position": 25.4}, 1e-3),
    "keyence": Case(serial(38400, "8N1"), DLRS1A, HEADS, 1e-4),
    "keyence MS": Case(serial(38400, "8N1"), {**DLRS1A, "request": "MS"}, HEADS, 1e-4),
    "keyence over TCP": Case(TCP, DLRS1A, HEADS, 1e-4),
    "modbus RTU": Case(RTU, MAP, SEEN, 1e-4),
    "modbus ASCII": Case({**RTU, "kind": "modbus_ascii", "format": "7E1"}, MAP, SEEN, 1e-4),
    "modbus RTU over TCP": Case({**RTU, "port": "socket://x:1"}, MAP, SEEN, 1e-4),
    "modbus TCP": Case({"kind": "modbus_tcp", "host": "x", "timeout_s": 0.1}, MAP, SEEN, 1e-4),
}
# What each fault is called: on lines of bytes, with RTU, with Modbus TCP (where pymodbus drops what does not fit), and
# with Modbus ASCII
NAMES: dict[str, tuple[set[Quality], ...]] = {
    "silent": ({Quality.TIMEOUT}, {Quality.TIMEOUT}, {Quality.TIMEOUT}, {Quality.TIMEOUT}),
    "garble": ({Quality.MISMATCH}, {Quality.CRC}, {Quality.TIMEOUT}, {Quality.CRC}),
    "late": ({Quality.TIMEOUT}, {Quality.TIMEOUT}, {Quality.TIMEOUT}, {Quality.TIMEOUT}),
    "cut": ({Quality.INCOMPLETE}, {Quality.INCOMPLETE}, {Quality.TIMEOUT}, {Quality.INCOMPLETE}),
    "noise before": ({Quality.MISMATCH}, {Quality.CRC}, {Quality.TIMEOUT}, {Quality.MISMATCH}),
    "wrong unit": (set(), {Quality.MISMATCH}, {Quality.TIMEOUT}, {Quality.MISMATCH}),
    "doubled": ({OK}, {OK}, {OK}, {OK}),
    "unplugged": ({Quality.LINE_LOST}, {Quality.LINE_LOST}, {Quality.LINE_LOST}, {Quality.LINE_LOST}),
}
KINDS = {"serial": 0, "tcp": 0, "modbus_rtu": 1, "modbus_tcp": 2, "modbus_ascii": 3}


def made(tmp_path: Path, case: Case) -> Any:
    return rig(tmp_path, case.line, {"g": case.gauge}, dict(case.values))


def expected(bench: Rig, case: Case) -> Outcome:
    return [
        (OK, pytest.approx(bench.values[channel.name], abs=0.51 * case.step)) for channel in bench.gauges["g"].channels
    ]


def test_every_driver_has_its_other_end() -> None:
    assert set(names(GAUGES)) == set(names(SIMULATED_GAUGES))


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_what_the_sensor_sees_arrives(tmp_path: Path, case: Case) -> None:
    with made(tmp_path, case) as bench, bench.open() as line:
        gauge = bench.gauges["g"]
        for sign in (1, -1, 1):
            bench.values.update({name: sign * value for name, value in case.values.items()})
            assert outcome(gauge, line) == expected(bench, case)


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_a_sensor_that_is_off_has_no_value(tmp_path: Path, case: Case) -> None:
    with made(tmp_path, case) as bench, bench.open() as line:
        gauge = bench.gauges["g"]
        bench.values.update(dict.fromkeys(case.values, NAN))
        for quality, value in outcome(gauge, line):
            assert quality in {Quality.SENSOR_FAULT, Quality.UNDER_RANGE, Quality.NOT_FINITE}
            assert math.isnan(value)
        bench.values.update(case.values)
        assert outcome(gauge, line) == expected(bench, case)


@pytest.mark.parametrize(("name", "fault"), sampled(product(CASES, NAMES), 5))
def test_each_fault_has_its_name_and_the_next_reading_is_right(tmp_path: Path, name: str, fault: str) -> None:
    case = CASES[name]
    allowed = NAMES[fault][KINDS[case.line["kind"]]]
    with made(tmp_path, case) as bench:
        gauge = bench.gauges["g"]
        if fault not in bench.wire.faults:
            assert not allowed
            with pytest.raises(ValueError, match=fault):
                bench.wire.fault = fault
            return
        with bench.open(case.line["timeout_s"]) as line:
            polled_until(gauge, line, lambda found: found == expected(bench, case))
            bench.wire.fault = fault
            if fault == "doubled":
                polled_until(gauge, line, lambda found: found == expected(bench, case))
            else:
                polled_until(gauge, line, lambda found: {quality for quality, _ in found} <= allowed)
            bench.wire.fault = None
            if fault != "unplugged":
                until("no reply is under way", lambda: not bench.wire.replies_under_way)
                line.drain()
                bench.values.update({name: value / 2 for name, value in case.values.items()})
                # a second copy that comes late breaks one more poll, but never passes
                polled_until(gauge, line, lambda found: found == expected(bench, case))
        with bench.open() as line:  # a new line object is right in any case
            assert outcome(gauge, line) == expected(bench, case)


def test_a_command_that_the_unit_does_not_know_is_an_error_of_its_own(tmp_path: Path) -> None:
    with made(tmp_path, CASES["keyence"]) as bench, bench.open() as line:
        line.send(b"XY\r\n")
        assert line.receive_until(b"\r\n", 20).startswith(b"ER,XY,")
