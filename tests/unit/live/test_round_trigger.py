"""The round trigger: all gauges of a line latched at once, on real ptys and ports; what happens when it fails."""

from __future__ import annotations

import itertools
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError
from pymodbus.framer.rtu import FramerRTU

from compd.gauge import Channel, Gauge, LineFault, Quality, Reading, good
from compd.lines import RtuMaster, StreamLine
from compd.live.acquisition.acquisition import Acquisition, LineThread
from compd.live.acquisition.possible_motion import MotionLimits
from compd.live.acquisition.reading_trust import ReadingTrust, TrustSettings
from compd.live.acquisition.round_trigger import read_latched
from compd.live.memory.trust_memory import TrustMemory
from compd.live.system import THIS_COMPUTER
from tests.support.patience import PATIENCE_S
from tests.support.wire_rig import SETTINGS, InstantClock, Rig, ScriptedPort, WatchedLatest, rig

OK = Quality.OK
UNITS = range(1, 10)
ASCII_LINE = {"kind": "serial", "port": "/dev/x", "baud": 115200, "format": "8N1", "timeout_s": PATIENCE_S}
RTU_LINE = {"kind": "modbus_rtu", "port": "/dev/x", "baud": 115200, "format": "8N1", "timeout_s": PATIENCE_S}


def ascii_gauge(unit: int) -> dict[str, Any]:
    form = {"out": f"?{unit}", "out_terminator": "\r", "in": f"{unit}%+09.3f", "in_terminator": "\r"}
    return {"driver": "serial_ascii", **form, "channels": [{"name": "v", "unit": "mm"}]}


def modbus_gauge(unit: int) -> dict[str, Any]:
    channel = {"name": "v", "function": 4, "address": 0, "type": "int16", "unit": "mm"}
    return {"driver": "modbus", "unit": unit, "channels": [channel]}


LINES = {
    "bytes": (ASCII_LINE | {"round_trigger": {"out": r"#**\r"}}, ascii_gauge),
    "bytes over TCP": (
        {
            "kind": "tcp",
            "host": "x",
            "port": 1,
            "timeout_s": PATIENCE_S,
            "round_trigger": {"out": "TRG", "out_terminator": "\r"},
        },
        ascii_gauge,
    ),
    "coil": (
        RTU_LINE | {"round_trigger": {"function": 5, "address": 7, "values": [1], "settle_s": 0.002}},
        modbus_gauge,
    ),
    "register": (
        RTU_LINE | {"round_trigger": {"function": 6, "address": 7, "values": [500], "settle_s": 0.0}},
        modbus_gauge,
    ),
    "registers, ASCII": (
        RTU_LINE
        | {"kind": "modbus_ascii", "format": "7E1"}
        | {"round_trigger": {"function": 16, "address": 7, "values": [1, 2], "settle_s": 0.0}},
        modbus_gauge,
    ),
    "the slave that latches the others": (
        RTU_LINE | {"round_trigger": {"function": 6, "address": 7, "values": [1], "unit": 3}},
        modbus_gauge,
    ),
    "Modbus TCP": (
        {"kind": "modbus_tcp", "host": "x", "port": 1, "timeout_s": PATIENCE_S}
        | {"round_trigger": {"function": 5, "address": 7, "values": [1], "unit": 1}},
        modbus_gauge,
    ),
}


class Replies(dict[str, float]):
    """What the devices sense: how many replies their line has given so far."""

    wire: Any = None

    def __getitem__(self, channel: str) -> float:
        return float(0 if self.wire is None else self.wire.replies)


@contextmanager
def acquiring(device_rig: Rig) -> Iterator[tuple[LineThread, WatchedLatest]]:
    latest = WatchedLatest([f"{name}.v" for name in device_rig.gauges])
    lines = {"line": (device_rig.settings, list(device_rig.gauges.items()))}
    acquisition = Acquisition(lines, dict.fromkeys(device_rig.gauges, 5.0), latest, THIS_COMPUTER)
    acquisition.start()
    try:
        yield acquisition.lines["line"], latest
    finally:
        assert acquisition.stop(PATIENCE_S)


def rounds(latest: WatchedLatest) -> list[list[Reading]]:
    """The whole rounds of good readings so far, each in the order of the gauges."""
    good_ones = [(name, reading) for name, reading in list(latest.history) if reading.ok]
    starts = [k for k, (name, _) in enumerate(good_ones) if name == latest.channels[0]]
    return [[reading for _, reading in good_ones[a:b]] for a, b in itertools.pairwise(starts)]


def values_by_time(latest: WatchedLatest, channel: str) -> dict[float, float]:
    """Of the channel's good readings so far."""
    return {reading.time_s: reading.value for name, reading in latest.history if name == channel and reading.ok}


@pytest.mark.parametrize("name", LINES)
def test_every_gauge_shows_what_it_sensed_at_the_trigger_and_has_its_time(tmp_path: Path, name: str) -> None:
    line, gauge = LINES[name]
    values = Replies()
    gauges = {f"g{unit}": gauge(unit) for unit in UNITS}
    with rig(tmp_path, line, gauges, values) as device_rig:
        values.wire = device_rig.wire
        with acquiring(device_rig) as (_, latest):
            for _ in range(5):
                latest.wait_for("g9.v", OK, latest.now)
    whole = [one_round for one_round in rounds(latest)[1:] if len(one_round) == len(UNITS)]
    assert len(whole) >= 2
    for readings in whole:
        assert len({reading.value for reading in readings}) == 1, "latched at once"
        assert len({reading.time_s for reading in readings}) == 1
    times_s = [readings[0].time_s for readings in whole]
    assert times_s == sorted(set(times_s)), "each round has a trigger of its own"


def test_without_a_trigger_they_are_apart(tmp_path: Path) -> None:
    values = Replies()
    with rig(tmp_path, ASCII_LINE, {f"g{unit}": ascii_gauge(unit) for unit in UNITS}, values) as device_rig:
        values.wire = device_rig.wire
        with acquiring(device_rig) as (_, latest):
            for _ in range(3):
                latest.wait_for("g9.v", OK, latest.now)
    readings = rounds(latest)[-1]
    assert len({reading.value for reading in readings}) == len(UNITS)
    assert len({reading.time_s for reading in readings}) == len(UNITS)


def test_the_others_keep_the_trigger_s_time_when_a_gauge_is_missing(tmp_path: Path) -> None:
    line = ASCII_LINE | {"timeout_s": 0.05, "round_trigger": {"out": r"#**\r"}}
    gauges = {f"g{unit}": ascii_gauge(unit) for unit in (1, 2, 3)}
    values = Replies()
    with rig(tmp_path, line, gauges, values) as device_rig:
        values.wire = device_rig.wire
        absent = {"g9": ascii_gauge(9)}
        driver = device_rig.gauges["g2"]
        options = driver.Options.model_validate({"line": "line", **absent["g9"]})
        device_rig.gauges["g2"] = type(driver)(options)  # no such device on the wire
        with acquiring(device_rig) as (_, latest):
            latest.wait_for("g2.v", Quality.TIMEOUT)
            shared: list[float] = []
            while len(shared) < 3:
                latest.wait_for("g3.v", OK, latest.now)
                first, third = (values_by_time(latest, channel) for channel in ("g1.v", "g3.v"))
                shared = sorted(first.keys() & third.keys())
    assert all(first[time_s] == third[time_s] for time_s in shared[1:])


def test_a_single_gauge_is_latched_before_it_is_read(tmp_path: Path) -> None:
    line, gauge = LINES["coil"]
    values = Replies()
    with rig(tmp_path, line, {"g": gauge(1)}, values) as device_rig, device_rig.open() as open_line:
        values.wire = device_rig.wire
        shown = [
            read_latched(device_rig.gauges["g"], open_line, device_rig.settings.round_trigger)[0].value
            for _ in range(3)
        ]
    assert shown == [0.0, 1.0, 2.0]


# --- the trigger that fails --------------------------------------------------------------------------------


class _Line:
    """A line on which only the trigger is scripted."""

    last_request_s = -1.0
    unexpected_bytes = 0
    request_came_back = False

    def __init__(self, clock: InstantClock, failing: set[int], quality: Quality) -> None:
        self.clock = clock
        self.sent = 0
        self._failing = failing
        self._quality = quality

    def send(self, request: bytes) -> float:
        self.sent += 1
        self.clock.now_s += 0.01
        if self.sent in self._failing:
            raise LineFault(self._quality, "the line is never quiet")
        return self.clock.now_s

    def rest_until(self, time_s: float) -> None:
        self.clock.now_s = max(self.clock.now_s, time_s)

    def drain(self, quiet_s: float | None = None) -> bytes:
        return b""

    def close(self) -> None:
        pass


class _Register(Gauge[Any]):
    """A device that shows how often the trigger was sent."""

    line_kind = "registers"

    def __init__(self, thread: list[Any], rounds_wanted: int) -> None:
        super().__init__(None)
        self._thread = thread
        self._wanted = rounds_wanted

    @property
    def channels(self) -> list[Channel]:
        return [Channel("v")]

    def read(self, line: Any) -> list[Reading]:
        line.clock.now_s += 0.02
        if line.sent >= self._wanted:
            self._thread[0].stop()
        return [good(float(line.sent), line.clock.now_s)]


def run(failing: set[int], quality: Quality = Quality.MISMATCH) -> tuple[WatchedLatest, LineThread]:
    clock = InstantClock()
    settings = SETTINGS.validate_python(
        {"kind": "tcp", "host": "x", "port": 1, "timeout_s": 0.1, "round_trigger": {"out": "T", "settle_s": 0.5}}
    )
    latest = WatchedLatest(["a.v", "b.v"])
    holder: list[Any] = []
    gauges = [("a", _Register(holder, 9)), ("b", _Register(holder, 9))]
    line = _Line(clock, failing, quality)
    thread = LineThread("line", settings, gauges, {"a": 0.1, "b": 0.1}, latest, clock, lambda *_: line)
    holder.append(thread)
    thread.start()
    assert thread.join(PATIENCE_S)
    return latest, thread


def test_where_the_trigger_fails_no_gauge_of_that_round_has_a_value() -> None:
    latest, thread = run({3})
    assert 3.0 not in {reading.value for _, reading in latest.history}
    for gauge in thread.gauges:
        assert gauge.faults[Quality.MISMATCH] == 1
    lost = [reading for name, reading in latest.history if name == "b.v" and not reading.ok]
    assert lost[0].detail == "round trigger: the line is never quiet"


def test_a_line_that_is_lost_at_the_trigger_is_opened_anew() -> None:
    latest, thread = run({2}, Quality.LINE_LOST)
    assert thread.lost == 1
    assert thread.opened == 2
    assert {reading.quality for _, reading in latest.history} == {OK, Quality.LINE_LOST}


def test_the_first_gauge_is_asked_when_the_devices_have_settled() -> None:
    latest, _ = run(set())
    first = next(reading for name, reading in latest.history if name == "a.v")
    assert first.time_s == pytest.approx(100.01), "the trigger's time, not that of the request half a second later"


# --- on the wire -------------------------------------------------------------------------------------------


def test_behind_a_broadcast_the_line_is_silent_as_long_as_between_frames() -> None:
    clock = InstantClock()
    sent_s: list[tuple[float, bytes]] = []

    def device(request: bytes) -> bytes:
        sent_s.append((clock.now_s, request))
        if request[0] == 0:
            return b""
        body = bytes([1, 4, 2 * request[5]]) + struct.pack(f">{request[5]}H", *range(request[5]))
        return body + FramerRTU.compute_CRC(body).to_bytes(2, "big")

    gap_s = 0.004
    master = RtuMaster(StreamLine(ScriptedPort(clock, device=device), 0.1, gap_s, clock))
    master.write(0, 5, 7, [1], 0.0)
    master.read_registers(1, 4, 0, 1)
    (broadcast_s, broadcast), (request_s, _) = sent_s
    assert broadcast[:6] == bytes.fromhex("00050007ff00")
    assert request_s - broadcast_s >= gap_s - 1e-9


# --- what is believed --------------------------------------------------------------------------------------


def trust(acceleration: float) -> ReadingTrust:
    memory = TrustMemory(["g.v"], [0.001])
    return ReadingTrust(memory, "g.v", TrustSettings(MotionLimits(acceleration=acceleration), False, 10.0, 0.5))


def test_a_latched_gauge_that_begins_to_move_is_believed_and_one_that_jumps_is_not() -> None:
    for moved_mm, believed in ((0.15, True), (2.0, False)):
        judge = trust(acceleration=10.0)
        for k in range(10):
            at = good(0.0, 100.0 + 0.2 * k)
            assert judge.judge(at, 1e-3, at if k == 0 else None).ok
        # 10 mm/s2 for the 0.2 s since the last latch: 0.2 mm, and not at rest again
        after = good(moved_mm, 102.0)
        judged = judge.judge(after, 1e-3, after)
        assert judged.ok == believed, moved_mm


def test_a_latched_gauge_that_goes_to_and_fro_scatters_though_each_sample_is_shown_twice() -> None:
    judge = trust(acceleration=10.0)
    for k in range(6):
        sample = good(0.0 if k < 2 else 0.005 * (-1) ** k, 100.0 + 0.2 * k)
        judged = judge.judge(sample, 1e-3, sample)
    assert judged.motion is not None
    assert judged.motion.scatter_mm == pytest.approx(0.01, rel=0.3)


# --- the configuration -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("line", "trigger", "words"),
    [
        (RTU_LINE, {"function": 5, "address": 1, "values": [1]}, "`settle_s` must say when"),
        (RTU_LINE, {"function": 5, "address": 1, "values": [2], "settle_s": 0}, "a coil is 0 or 1"),
        (RTU_LINE, {"function": 6, "address": 1, "values": [2, 3], "settle_s": 0}, "writes one value"),
        (RTU_LINE, {"function": 3, "address": 1, "values": [2], "settle_s": 0}, "function"),
        (RTU_LINE, {"out": "T"}, "out"),
        (ASCII_LINE, {"out": ""}, "out"),
        (ASCII_LINE, {"out": r"\q"}, "unknown escape"),
        (ASCII_LINE, {"function": 5, "address": 1, "values": [1]}, "function"),
    ],
)
def test_a_trigger_that_cannot_be_sent_is_refused(line: Any, trigger: Any, words: str) -> None:
    with pytest.raises(ValidationError, match=words):
        SETTINGS.validate_python(line | {"round_trigger": trigger})
