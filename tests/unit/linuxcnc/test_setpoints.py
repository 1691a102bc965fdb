"""What the bridge uses of what it hears, and what it refuses."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest

from compd.setpoint_states import State
from tests.support.bridge_daemon import BridgeDaemon
from tests.support.hand_clock import HandClock
from tests.support.simulated import run_directory

import compd_setpoints as bridge  # isort: skip

NOW_S = 1000.0
LIMIT_MM = 0.2


def setpoint(**changes: Any) -> dict[str, Any]:
    message = {
        "class": "SETPOINT",
        "seq": 7,
        "time_s": NOW_S - 0.001,
        "valid": True,
        "state": "ok",
        "reason": "",
        "valid_until": NOW_S + 0.099,
        "mode": "cmm",
        "correction_mm": [0.01, -0.02, 0.0, 0.2, -0.2, 0.003],
    }
    return {key: value for key, value in (message | changes).items() if value is not None}


def judge(**settings: Any) -> bridge.Judge:
    return bridge.Judge(**({"links": 6, "limit_mm": LIMIT_MM, "same_clock": True} | settings))


def test_a_good_setpoint_is_used_until_it_expires() -> None:
    verdict = judge().judge(setpoint(), NOW_S)
    assert verdict == bridge.Setpoint(7, (0.01, -0.02, 0.0, 0.2, -0.2, 0.003), NOW_S + 0.099)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"valid": False, "correction_mm": None, "state": "stop"}, bridge.NOT_VALID),
        ({"valid": None}, bridge.NOT_VALID),
        ({"valid": 1}, bridge.NOT_VALID),
        ({"state": "better_than_ok"}, bridge.NOT_VALID),
        ({"state": "fault"}, bridge.NOT_VALID),
        ({"valid_until": NOW_S}, bridge.EXPIRED),
        ({"valid_until": NOW_S - 5.0}, bridge.EXPIRED),
        ({"valid_until": math.inf}, bridge.NOT_FINITE),
        ({"valid_until": None}, bridge.UNREADABLE),
        ({"time_s": math.nan}, bridge.NOT_FINITE),
        ({"time_s": NOW_S + 60.0, "valid_until": NOW_S + 60.1}, bridge.CLOCKS),
        ({"seq": None}, bridge.UNREADABLE),
        ({"seq": True}, bridge.UNREADABLE),
        ({"seq": "8"}, bridge.UNREADABLE),
        ({"correction_mm": None}, bridge.WRONG_LINKS),
        ({"correction_mm": [0.0] * 3}, bridge.WRONG_LINKS),
        ({"correction_mm": [0.0] * 5 + ["0"]}, bridge.UNREADABLE),
        ({"correction_mm": [0.0] * 5 + [math.nan]}, bridge.NOT_FINITE),
        ({"correction_mm": [0.0] * 5 + [-math.inf]}, bridge.NOT_FINITE),
        ({"correction_mm": [0.0] * 5 + [0.2001]}, bridge.TOO_LARGE),
        ({"correction_mm": [0.0] * 5 + [-5.0]}, bridge.TOO_LARGE),
    ],
)
def test_anything_else_is_refused_with_its_reason(changes: dict[str, Any], reason: int) -> None:
    assert judge().judge(setpoint(**changes), NOW_S) == bridge.Refused(reason)


def test_what_json_calls_nan_is_refused() -> None:
    message = json.loads(json.dumps(setpoint(correction_mm=[math.nan] * 6)))
    assert judge().judge(message, NOW_S) == bridge.Refused(bridge.NOT_FINITE)


@pytest.mark.parametrize("seq", [7, 6])
def test_a_setpoint_that_came_already_is_refused_and_the_next_one_is_not(seq: int) -> None:
    one = judge()
    one.judge(setpoint(), NOW_S)
    assert one.judge(setpoint(seq=seq), NOW_S) == bridge.Refused(bridge.OLD_SEQ)
    assert isinstance(one.judge(setpoint(seq=8), NOW_S), bridge.Setpoint)


def test_the_states_that_the_bridge_knows_are_those_that_are_valid() -> None:
    assert {state.value for state in State if state.valid} == bridge.VALID_STATES


def test_on_another_computers_clock_a_message_that_waited_is_as_old_as_it_waited() -> None:
    """The daemon's clock is 5000 s ahead. The bridge is stopped for 0.3 s, and reads then what came meanwhile."""
    one = judge(same_clock=False)
    ahead_s = 5000.0
    for seq in range(100):
        now_s = NOW_S + seq * 0.005
        sent_s = now_s + ahead_s
        verdict = one.judge(setpoint(seq=seq, time_s=sent_s, valid_until=sent_s + 0.1), now_s)
        assert isinstance(verdict, bridge.Setpoint)
        assert verdict.expires_s == pytest.approx(now_s + 0.1)
    sent_s = NOW_S + 0.5 + ahead_s
    late = one.judge(setpoint(seq=100, time_s=sent_s, valid_until=sent_s + 0.1), NOW_S + 0.8)
    assert late == bridge.Refused(bridge.EXPIRED)


def test_clocks_that_drift_apart_are_followed() -> None:
    """A tenth of a second per thousand seconds: after an hour, 0.36 s, and each setpoint is still good."""
    one = judge(same_clock=False)
    for seq in range(36_000):
        now_s = NOW_S + seq * 0.1
        sent_s = now_s - seq * 1e-5
        assert isinstance(one.judge(setpoint(seq=seq, time_s=sent_s, valid_until=sent_s + 0.1), now_s), bridge.Setpoint)


def test_the_frames_displacement_is_refused_like_a_correction() -> None:
    frame = {
        "origin_M_mm": [0.0, 0.0, 900.01],
        "displacement_M_mm": [0.0, 0.0, 0.01],
        "rotation_M_rad": [1e-5, 0.0, 0.0],
    }
    wanted = judge(frame=True)
    good = wanted.judge(setpoint(frame=frame), NOW_S)
    assert isinstance(good, bridge.Setpoint)
    assert good.frame == (0.0, 0.0, 900.01, 0.0, 0.0, 0.01, 1e-5, 0.0, 0.0)
    assert wanted.judge(setpoint(seq=8), NOW_S) == bridge.Refused(bridge.UNREADABLE)
    bad = frame | {"rotation_M_rad": [math.nan, 0.0, 0.0]}
    assert wanted.judge(setpoint(seq=9, frame=bad), NOW_S) == bridge.Refused(bridge.NOT_FINITE)


def test_the_stream_asks_for_setpoints_reads_lines_that_come_in_pieces_and_connects_again() -> None:
    clock = HandClock()
    with run_directory() as directory:
        path = str(directory / "compd.sock")
        stream = bridge.Stream(path, clock=clock.monotonic)
        assert stream.poll() == []  # nobody there
        daemon = BridgeDaemon(directory / "compd.sock")
        assert stream.poll() == []  # it tries again after half a second
        clock.now_s += 0.6
        stream.poll()
        daemon.greet()
        assert [message["class"] for message in stream.poll()] == ["VERSION"]
        assert stream.greeted
        assert json.loads(daemon.connection.recv(1000)) == {"class": "WATCH"}
        daemon.send(b'{"class":"SETPOINT","se')
        assert stream.poll() == []
        daemon.send(b'q":1}\n{"class":"SETPOINT","seq":2}\n')
        assert [message["seq"] for message in stream.poll()] == [1, 2]
        daemon.connection.close()
        assert stream.poll() == []
        assert not stream.greeted
        clock.now_s += 0.6
        stream.poll()
        daemon.greet()
        assert [message["class"] for message in stream.poll()] == ["VERSION"]
        stream.close()
        daemon.close()


@pytest.mark.parametrize("what", ["silence", "no JSON", "a line without end"])
def test_the_stream_leaves_what_is_not_a_living_daemon(what: str) -> None:
    clock = HandClock()
    with run_directory() as directory:
        daemon = BridgeDaemon(directory / "compd.sock")
        stream = bridge.Stream(str(directory / "compd.sock"), clock=clock.monotonic)
        stream.poll()
        daemon.greet()
        stream.poll()
        if what == "silence":
            clock.now_s += 2.1
        elif what == "no JSON":
            daemon.send(b"HTTP/1.1 400\n")
        else:
            stream._buffer = b"x" * (bridge.MAX_LINE + 1)
        assert stream.poll() == []
        assert not stream.greeted
        daemon.close()
