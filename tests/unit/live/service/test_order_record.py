"""Who ordered what: in the log, and among the messages that a recorder gets."""

from __future__ import annotations

import json
import os
from dataclasses import replace

import pytest
import structlog

from compd.live.service.messages import ErrorCode, ProtocolError

BY = "anna (operate) from 10.0.0.5"
NAME = f"unix, user {os.getuid()}"


@pytest.fixture
def log():
    with structlog.testing.capture_logs() as log:
        yield log


@pytest.fixture
def recorder(service):
    """A client that watches READINGS; of these only the orders come here."""
    context = service.requests.context
    context.messages = replace(
        context.messages, readings=type("Readings", (), {"columns": [], "from_setpoints": {}, "line": None})
    )
    peer = service.unix()
    assert peer.ask({"class": "WATCH", "what": "readings"})["class"] == "WATCH"
    return peer


def orders(log):
    return [
        tuple(entry.get(key) for key in ("event", "order", "subject", "client", "by", "reason"))
        for entry in log
        if entry["event"].startswith("order ")
    ]


def test_an_order_that_is_done_is_logged_and_recorded(service, recorder, log):
    assert service.unix().ask({"class": "ACCEPT", "gauge": "joints", "by": BY})["class"] == "ACCEPT"
    message = recorder.read()
    assert message.pop("time_s") > 0
    assert message == {
        "class": "ORDER", "order": "ACCEPT", "subject": "joints", "client": NAME, "by": BY, "done": True
    }  # fmt: skip
    assert orders(log) == [("order done", "ACCEPT", "joints", NAME, BY, None)]


def test_an_order_that_is_refused_says_why_in_the_log(service, recorder, log):
    assert service.unix().ask({"class": "POLL", "gauge": "none"})["code"] == "bad_message"
    message = recorder.read()
    assert (message["order"], message["subject"], message["done"]) == ("POLL", "none", False)
    assert "by" not in message
    ((event, order, subject, client, by, reason),) = orders(log)
    assert (event, order, subject, client, by) == ("order refused", "POLL", "none", NAME, "")
    assert "none" in reason


@pytest.mark.parametrize(
    ("answer", "done"),
    [
        (b'{"class":"ZERO","taken_at":"now"}\n', True),
        (ProtocolError(ErrorCode.ZERO_REFUSED, "it moved").to_json(), False),
    ],
)
def test_an_order_that_takes_time_is_recorded_when_it_is_known_what_became_of_it(service, recorder, log, answer, done):
    peer = service.unix()
    peer.send({"class": "ZERO", "replace": True, "by": BY})
    peer.ask({"class": "STATUS"})
    assert orders(log) == []
    service.zeros[0][1](answer)
    assert peer.read() == json.loads(answer)
    message = recorder.read()
    assert (message["order"], message["subject"], message["by"], message["done"]) == ("ZERO", "replace", BY, done)


def test_a_model_order_names_its_file_and_what_it_is_for(service, recorder):
    peer = service.unix()
    for request in (
        {"file": "/m.yaml", "shadow": True},
        {"file": "/m.yaml"},
        {"file": ""},
        {"hash": "0123456789abcdef"},
    ):
        peer.send({"class": "MODEL", **request})
    peer.ask({"class": "STATUS"})
    for _, _, answer in service.models:
        answer(b'{"class":"MODEL"}\n')
    assert [recorder.read()["subject"] for _ in range(4)] == [
        "run as the shadow /m.yaml",
        "apply /m.yaml",
        "apply none",
        "apply the shadow 0123456789abcdef",
    ]


def test_what_a_client_writes_disturbs_neither_log_nor_recording(service, recorder, log):
    assert service.unix().ask({"class": "ACCEPT", "gauge": "a\nb\x1b" + "x" * 2000})["code"] == "bad_message"
    assert recorder.read()["subject"] == "a?b?" + "x" * 996
    assert orders(log)[0][2].isprintable()


def test_a_question_is_no_order(service, log):
    peer = service.unix()
    for request in ({"class": "MODEL"}, {"class": "MODEL", "by": BY}, {"class": "STATUS"}, {"class": "VERSION"}):
        peer.ask(request)
    assert orders(log) == []


def test_whoever_gives_and_takes_the_controllers_role_is_logged_with_its_user(service, recorder, log):
    controller, other = service.unix(), service.unix()
    controller.send({"class": "TARGET", "tip_B0_mm": [1, 2, 3]})
    controller.ask({"class": "STATUS"})
    assert other.ask({"class": "RELEASE", "by": BY}) == {"class": "RELEASE"}
    assert recorder.read()["order"] == "RELEASE"
    said = {entry["event"]: entry["client"] for entry in log if "controller" in entry["event"]}
    assert said == {
        "controller": NAME,
        "the controller has lost its role": NAME,
        "no controller any more": NAME,
    }


@pytest.mark.parametrize("by", ["a\nb", "a\x1b[2J", "x" * 201, 7])
def test_for_whom_is_one_short_line(service, by):
    answer = service.unix().ask({"class": "POLL", "gauge": "scale_1", "by": by})
    assert answer["code"] == "bad_message"
    assert answer["text"].startswith("by ")


def test_only_orders_have_it(service):
    assert "unknown key 'by'" in service.unix().ask({"class": "STATUS", "by": BY})["text"]


def test_status_tells_each_clients_user(service):
    service.unix().ask({"class": "STATUS"})
    (client,) = service.publisher.summary()["connected"]
    assert (client["name"], client["user"]) == (NAME, os.getuid())
