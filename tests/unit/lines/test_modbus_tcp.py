"""Modbus TCP: each way to fail has its name, and no old reply is taken for a new one."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from compd.clock import MonotonicClock
from compd.gauge import LineFault, Quality
from compd.lines import open_line
from compd.lines.kinds.modbus_tcp.master import ModbusTcp
from tests.support.patience import PATIENCE_S
from tests.support.serial_gateway import serial_gateway
from tests.support.watching import until
from tests.support.wire_rig import InstantClock, Rig, polled_until, rig

LINE = {"kind": "modbus_tcp", "host": "x", "timeout_s": 0.1}
GAUGE: dict[str, Any] = {
    "driver": "modbus",
    "unit": 7,
    "channels": [{"name": "a", "function": 4, "address": 0, "type": "int16", "unit": "degC", "scale": 0.1}],
}


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Rig]:
    with rig(tmp_path, LINE, {"room": GAUGE}, {"a": 21.5}) as made:
        yield made


def quality_of(line: Any, unit: int = 7, function: int = 4, address: int = 0, count: int = 1) -> Quality:
    with pytest.raises(LineFault) as caught:
        line.read_registers(unit, function, address, count)
    return caught.value.quality


def test_registers_of_both_functions(bench: Rig) -> None:
    with bench.open() as line:
        assert line.read_registers(7, 4, 0, 2).registers == (215, 0)
        assert quality_of(line, function=3) is Quality.DEVICE_ERROR, "this map has no holding registers"
        assert line.read_registers(7, 4, 0, 1).registers == (215,), "an exception does not cost the connection"


def test_an_exception_has_its_name(bench: Rig) -> None:
    with bench.open() as line, pytest.raises(LineFault, match="illegal data address"):
        line.read_registers(7, 4, 4, 10)


def test_the_pause_before_the_next_request(bench: Rig) -> None:
    clock = InstantClock()
    settings: Any = bench.settings.model_copy(update={"pause_s": 0.03})
    line = open_line(settings, clock)
    for _ in range(3):
        line.read_registers(7, 4, 0, 1)  # type: ignore[union-attr]
    line.close()
    assert clock.waits_s == pytest.approx([0.03, 0.03]), "none before the first"


def test_an_absent_unit_times_out(bench: Rig) -> None:
    with bench.open(0.1) as line:
        assert quality_of(line, unit=8) is Quality.TIMEOUT
        polled_until(bench.gauges["room"], line, lambda found: found == [(Quality.OK, pytest.approx(21.5))])


@pytest.mark.parametrize("fault", ["silent", "garble", "late", "cut", "wrong unit", "noise before"])
def test_a_broken_reply_is_a_fault_and_the_next_one_is_right(bench: Rig, fault: str) -> None:
    with bench.open(0.1) as line:
        bench.wire.fault = fault
        assert quality_of(line) is Quality.TIMEOUT
        bench.wire.fault = None
        until("no reply is under way", lambda: not bench.wire.replies_under_way)
        bench.values["a"] = -4.2
        polled_until(bench.gauges["room"], line, lambda found: found == [(Quality.OK, pytest.approx(-4.2))])


def test_a_closed_connection_is_a_lost_line_and_a_new_object_helps(bench: Rig) -> None:
    with bench.open() as line:
        bench.wire.fault = "unplugged"
        assert quality_of(line) is Quality.LINE_LOST
        with pytest.raises(LineFault) as caught:
            open_line(bench.settings, MonotonicClock())
        assert caught.value.quality is Quality.LINE_LOST
        bench.wire.fault = None
    with bench.open() as line:
        assert line.read_registers(7, 4, 0, 1).registers == (215,)


@contextmanager
def answering(message: bytes, timeout_s: float = 0.1) -> Iterator[ModbusTcp]:
    """A line whose first request is answered by `message` in a right frame."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        host, port = listener.getsockname()
        line = ModbusTcp(host, port, timeout_s, MonotonicClock())
        device, _ = listener.accept()
        with device:
            # pymodbus numbers its transactions from 1
            device.sendall(bytes([0, 1, 0, 0, 0, len(message)]) + message)
            yield line
        line.close()


@pytest.mark.parametrize(
    "message",
    [
        bytes([7, 4, 4, 0, 1, 0, 2]),  # two registers for one
        bytes([7, 3, 2, 0, 1]),  # another function
        bytes([7, 4, 2, 0]),  # half a register
        bytes([7, 4, 9, 0, 1]),  # a byte count that is not there
        bytes([7, 4]),
        bytes([7, 99, 1, 2, 3]),
    ],
)
def test_a_well_framed_reply_that_is_none_never_passes(message: bytes) -> None:
    with answering(message) as line:
        assert quality_of(line) in {Quality.MISMATCH, Quality.TIMEOUT}


def test_a_well_framed_reply_that_is_one_passes() -> None:
    with answering(bytes([7, 4, 2, 0, 1]), PATIENCE_S) as line:
        assert line.read_registers(7, 4, 0, 1).registers == (1,)


# --- Behind a gateway with one serial bus ---------------------------------------------------------------------


def registers_in_time(line: ModbusTcp, unit: int, count: int) -> tuple[int, ...]:
    """Of a unit that is asked until its answer comes in time: the gateway may have had no processor."""
    while True:
        try:
            return tuple(line.read_registers(unit, 4, 0, count).registers)
        except LineFault as fault:
            if fault.quality is not Quality.TIMEOUT:
                raise


@pytest.mark.parametrize("exceptions", [True, False], ids=["exception 11", "silence"])
def test_a_reply_behind_a_dead_unit_comes_by_its_own_number_on_the_same_connection(exceptions: bool) -> None:
    with serial_gateway(units=3, exchange_s=0.0, wait_s=0.5, exceptions=exceptions) as gateway:
        gateway.dead.add(2)
        line = ModbusTcp("127.0.0.1", gateway.port, 0.2, MonotonicClock(), gateway_wait_s=0.5)
        for _ in range(2):
            assert quality_of(line, unit=2) is Quality.TIMEOUT
            assert registers_in_time(line, 1, 2) == (1, 1), "the gateway has come to it"
            assert registers_in_time(line, 3, 1) == (3,)
        line.close()
        assert gateway.connections == 1


def test_late_replies_of_others_are_never_taken_where_the_gateway_waits_for_longer_than_expected() -> None:
    with serial_gateway(units=3, exchange_s=0.0, wait_s=0.5, exceptions=True) as gateway:
        gateway.dead.add(2)
        line = ModbusTcp("127.0.0.1", gateway.port, 0.1, MonotonicClock())
        assert quality_of(line, unit=2) is Quality.TIMEOUT
        answers: list[tuple[int, tuple[int, ...]]] = []
        faults = set()
        while len(answers) < 3:
            unit = 1 + 2 * (len(answers) % 2)
            try:
                answers.append((unit, line.read_registers(unit, 4, 0, 1).registers))
            except LineFault as fault:
                faults.add(fault.quality)
        line.close()
        assert faults == {Quality.TIMEOUT}
        assert answers == [(1, (1,)), (3, (3,)), (1, (1,))]
        assert gateway.connections == 1
