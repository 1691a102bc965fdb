"""The protocol over real sockets: every message, every error, and nobody harmed by another's."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from compd.clock import MonotonicClock
from compd.live.service.messages import MAX_LINE_BYTES, line
from compd.live.service.model_switch import ModelWish
from compd.live.service.requests import REQUESTS, Asker
from compd.setpoint_states import State
from tests.support.service import PERIOD_S, VERSION, setpoint


@pytest.mark.parametrize("kind", ["unix", "tcp"])
def test_version_greets_and_every_setpoint_comes_once_in_order(service, kind):
    peer = getattr(service, kind)()
    assert peer.version == VERSION
    assert peer.ask({"class": "WATCH"}) == {"class": "WATCH"}
    now_s = MonotonicClock().monotonic()
    for seq in range(1, 101):
        service.deliver(setpoint(seq, now_s + seq * PERIOD_S))
    received = [peer.read() for _ in range(100)]
    assert [message["seq"] for message in received] == list(range(1, 101))
    assert {message["class"] for message in received} == {"SETPOINT"}


def test_a_rate_thins_the_setpoints_evenly_and_zero_stops_them(service):
    peer = service.tcp()
    assert peer.ask({"class": "WATCH", "rate_hz": 20}) == {"class": "WATCH", "rate_hz": 20}
    now_s = MonotonicClock().monotonic()
    for seq in range(1, 201):
        service.deliver(setpoint(seq, now_s + seq * PERIOD_S))
    seqs = [peer.read()["seq"] for _ in range(20)]
    assert set(np.diff(seqs)) == {10}, "200 Hz thinned to 20 Hz"
    peer.ask({"class": "WATCH", "rate_hz": 0})
    service.deliver(setpoint(999, now_s + 9))
    assert peer.ask({"class": "STATUS"}) == {"class": "STATUS"}, "and no setpoint in between"


def test_who_does_not_watch_gets_nothing_and_state_changes_are_still_observed(service):
    peer = service.unix()
    service.deliver(setpoint(1))
    service.deliver(setpoint(2))
    service.deliver(setpoint(3)._replace(state=State.HOLD))
    assert peer.ask({"class": "STATUS"})["class"] == "STATUS"
    assert [s.seq for s in service.observed] == [1, 3]


DEEP = b"[" * (MAX_LINE_BYTES - 10)
BAD = [
    (b"hello\n", "bad_json"),
    (b"{\n", "bad_json"),
    (b"\xff\xfe\x00\n", "bad_json"),
    (b"[1,2]\n", "bad_json"),
    (b'"WATCH"\n', "bad_json"),
    (DEEP + b"\n", "bad_json"),
    (b'{"class":"WATCH","rate_hz":NaN}\n', "bad_json"),
    (b'{"class":"WATCH","rate_hz":1,"rate_hz":200}\n', "bad_json"),
    (b'{"class":"STATUS","class":"VERSION"}\n', "bad_json"),
    (b'{"class":"WATCH","rate_hz":' + b"9" * 4000 + b"}\n", "bad_message"),
    (b'{"class":"WATCH","rate_hz":1e999}\n', "bad_message"),
    (b'{"class":"WATCH","rate_hz":-1}\n', "bad_message"),
    (b'{"class":"WATCH","rate_hz":true}\n', "bad_message"),
    (b'{"class":"WATCH","rate_hz":"10"}\n', "bad_message"),
    (b'{"class":"WATCH","rate":10}\n', "bad_message"),
    (b'{"class":7}\n', "bad_message"),
    (b"{}\n", "bad_message"),
    (b'{"class":"\\ud800"}\n', "unknown_class"),
    (b'{"class":"STATUS","\\ud800":1}\n', "bad_message"),
    (b'{"class":"watch"}\n', "unknown_class"),
    (b'{"class":"SETPOINT"}\n', "unknown_class"),
    (b'{"class":"TARGET"}\n', "bad_message"),
    (b'{"class":"TARGET","tip_B0_mm":[1,2]}\n', "bad_message"),
    (b'{"class":"TARGET","tip_B0_mm":[1,2,null]}\n', "bad_message"),
    (b'{"class":"TARGET","tip_B0_mm":[1,2,"3"]}\n', "bad_message"),
    (b'{"class":"TARGET","tip_B0_mm":[1,2,Infinity]}\n', "bad_json"),
    (b'{"class":"TARGET","tip_B0_mm":[1,2,3],"rotation_B0_rad":[0,0,0]}\n', "bad_message"),
    (b'{"class":"TARGET","tip_P_mm":[1,2,3]}\n', "bad_message"),
    (b'{"class":"RELEASE"}\n', "not_controller"),
    (b"x" * (MAX_LINE_BYTES + 1) + b"\n", "line_too_long"),
    (b"x" * (20 * MAX_LINE_BYTES) + b"\n", "line_too_long"),
]


@pytest.mark.parametrize(("message", "code"), BAD, ids=[f"{code}-{i}" for i, (_, code) in enumerate(BAD)])
def test_a_bad_message_gets_an_error_and_harms_nobody(service, message, code):
    other, peer = service.tcp(), service.tcp()
    other.ask({"class": "WATCH"})
    peer.send(message)
    answer = peer.read()
    assert answer["class"] == "ERROR"
    assert answer["code"] == code
    assert answer["text"]
    assert peer.ask({"class": "VERSION"}) == VERSION, "the connection stays"
    service.deliver(setpoint(1, MonotonicClock().monotonic()))
    assert other.read()["seq"] == 1
    assert service.commands.target is None


def test_an_empty_line_is_ignored(service):
    peer = service.tcp()
    peer.send(b"\n  \n")
    assert peer.ask({"class": "VERSION"}) == VERSION


@pytest.mark.parametrize(
    ("message", "text"),
    [
        ({"class": "watch"}, f"class 'watch', allowed: {', '.join(REQUESTS)}"),
        ({"class": "STATUS", "why": 1}, "STATUS: unknown key 'why', allowed: none"),
        ({"class": "WATCH", "rate_hz": "10"}, "rate_hz must be a number, is str"),
        ({"class": "WATCH", "rate_hz": -1}, "rate_hz is -1, allowed 0 or more"),
        ({"class": "WATCH", "rate_hz": 2e9}, "rate_hz must be within +-1e+09"),
        ({"class": "WATCH", "what": "x"}, "what is 'x', allowed: setpoints, readings"),
        ({"class": "TARGET"}, "needs tip_B0_mm, three numbers"),
        ({"class": "TARGET", "tip_B0_mm": [1, 2]}, "tip_B0_mm must be a list of three numbers"),
        ({"class": "TARGET", "tip_B0_mm": [1, 2, None]}, "tip_B0_mm must be a number, is NoneType"),
        ({"class": "TARGET", "tip_B0_mm": [1, 2, -2e9]}, "tip_B0_mm must be within +-1e+09"),
        ({"class": "TARGET", "tip_P_mm": [1, 2, 3]}, "TARGET: unknown key 'tip_P_mm', allowed: tip_B0_mm, time_s, id"),
        ({"class": "MODEL", "shadow": True}, "needs file, a text (shadow: true or false)"),
        (
            {"class": "MODEL", "file": "m.yaml"},
            "file is 'm.yaml', allowed: an absolute path in printable characters, or \"\"",
        ),
        (
            {"class": "MODEL", "file": "/m\0"},
            "file is '/m\\x00', allowed: an absolute path in printable characters, or \"\"",
        ),
        (
            {"class": "MODEL", "file": "/\ud800"},
            "file is '/\\ud800', allowed: an absolute path in printable characters, or \"\"",
        ),
        ({"class": "MODEL", "hash": "0" * 16, "shadow": True}, "hash stands alone: the model that has it is applied"),
        ({"class": "POLL", "gauge": "scale_1", "by": "a\nb"}, "by must be one line of printable characters"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_an_error_names_the_key_its_value_and_what_is_allowed(service, message, text):
    answer = service.unix().ask(message)
    assert answer["class"] == "ERROR"
    assert answer["text"] == text


def test_the_answer_to_watch_repeats_the_keys_as_they_were_written(service):
    peer = service.tcp()
    for request in (b'{"class":"WATCH","rate_hz":20}\n', b'{"class":"WATCH","what":"setpoints","rate_hz":20.0}\n'):
        peer.send(request)
        assert peer.file.readline() == request


def test_a_model_is_switched_over_the_unix_socket_alone(service):
    remote, local = service.tcp(), service.unix()
    for request in ({"class": "MODEL"}, {"class": "MODEL", "file": "/m.yaml"}):
        assert remote.ask(request)["code"] == "unix_only"
    assert local.ask({"class": "MODEL"}) == {"class": "MODEL"}
    local.send({"class": "MODEL", "file": "/m.yaml", "shadow": True})
    local.send({"class": "MODEL", "file": ""})
    local.ask({"class": "STATUS"})
    local.send({"class": "MODEL", "hash": "0123456789abcdef"})
    local.ask({"class": "STATUS"})
    assert [wish for wish, _, _ in service.models] == [
        ModelWish("/m.yaml", shadow=True),
        ModelWish(""),
        ModelWish(hash="0123456789abcdef"),
    ]


def test_every_request_documents_itself_and_each_of_its_keys():
    for name, kind in REQUESTS.items():
        assert kind.__doc__, name
        assert all(field.description for field in kind.model_fields.values()), name
        assert bool(kind.refusal) == (kind.asker is not Asker.ANYBODY), name


def test_a_message_may_come_in_pieces_and_several_in_one_piece(service):
    peer = service.tcp()
    for piece in (b'{"cla', b'ss":"VER', b'SION"}\n{"class":"STATUS"}\n\n \n{"class"', b':"VERSION"}\r\n'):
        peer.send(piece)
    assert [peer.read()["class"] for _ in range(3)] == ["VERSION", "STATUS", "VERSION"]


def test_zero_over_tcp_is_refused_and_over_unix_answered_when_done(service):
    assert service.tcp().ask({"class": "ZERO"})["code"] == "unix_only"
    assert service.zeros == []
    peer = service.unix()
    peer.send({"class": "ZERO"})
    assert peer.ask({"class": "STATUS"})["class"] == "STATUS", "the publisher does not wait for it"
    ((_, answer),) = service.zeros
    threading.Thread(target=answer, args=(line({"class": "ZERO", "taken_at": "now"}),)).start()
    assert peer.read() == {"class": "ZERO", "taken_at": "now"}


def test_a_poll_is_asked_for_over_the_unix_socket_alone(service):
    assert service.tcp().ask({"class": "POLL", "gauge": "scale_1"})["code"] == "unix_only"
    peer = service.unix()
    assert peer.ask({"class": "POLL", "gauge": "scale_1"}) == {"class": "POLL"}
    assert service.poll_requests.count("scale_1") == 1
    unknown = peer.ask({"class": "POLL", "gauge": "scale_9"})
    assert unknown["code"] == "bad_message"
    assert unknown["text"] == "no gauge that is polled is called 'scale_9', allowed: scale_1"


def test_gauges_are_accepted_over_the_unix_socket_alone(service):
    assert service.tcp().ask({"class": "ACCEPT", "gauge": "all"})["code"] == "unix_only"
    peer = service.unix()
    assert peer.ask({"class": "ACCEPT", "gauge": "scale_1"}) == {"class": "ACCEPT", "gauges": ["scale_1.position"]}
    assert peer.ask({"class": "ACCEPT", "gauge": "all"}) == {"class": "ACCEPT", "gauges": ["joints.1", "joints.2"]}
    assert peer.ask({"class": "ACCEPT", "gauge": "all"}) == {"class": "ACCEPT", "gauges": []}
    unknown = peer.ask({"class": "ACCEPT", "gauge": "scale_9"})
    assert (unknown["code"], unknown["text"]) == ("bad_message", "no gauge scale_9; there are ")
    for gauge in ({}, {"gauge": ""}, {"gauge": 1}):
        assert peer.ask({"class": "ACCEPT", **gauge})["code"] == "bad_message"
