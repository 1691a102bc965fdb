"""Commands that are started right behind another one wait for it, and say so."""

from __future__ import annotations

import threading

import pytest

from compd.cli.waiting import PATIENCE_S, connect_patiently, wait_for_file, wait_for_gauges
from compd.client import connect
from compd.errors import ConfigurationError, DaemonError
from compd.live.service.messages import line


class Turned:
    """A clock that moves by what is waited for; `at` is called at each look."""

    def __init__(self, at=lambda now_s: None):
        self.now_s = 0.0
        self.at = at

    def monotonic(self):
        return self.now_s

    def wait(self, event, timeout_s):
        self.now_s += timeout_s
        self.at(self.now_s)
        return event.is_set()


def test_a_file_that_comes_is_waited_for_and_one_that_is_there_is_not(tmp_path, capsys):
    path = tmp_path / "m.yaml"
    clock = Turned(lambda now_s: path.write_text("") if now_s > 5 else None)
    wait_for_file(path, clock)
    assert 5 < clock.now_s < 6
    assert capsys.readouterr().err == f"{path} is not there yet: waiting up to 30 s\n"
    wait_for_file(path, clock)
    assert capsys.readouterr().err == ""


def test_after_its_patience_the_usual_error_comes(tmp_path, capsys):
    clock = Turned()
    with pytest.raises(DaemonError, match="no daemon answers: No such file or directory"):
        connect_patiently(str(tmp_path / "s"), connect, clock)
    assert PATIENCE_S <= clock.now_s < PATIENCE_S + 1
    assert capsys.readouterr().err.count("no daemon answers yet: waiting up to 30 s") == 1


def test_a_configuration_that_never_comes_is_the_usual_error_too(tmp_path):
    with pytest.raises(ConfigurationError):
        connect_patiently(str(tmp_path / "m.yaml"), connect, Turned())


def test_a_daemon_that_starts_meanwhile_is_connected_to(tmp_path):
    import socket

    path = tmp_path / "s"
    listener = socket.socket(socket.AF_UNIX)

    def greet():
        connection, _ = listener.accept()
        connection.sendall(line({"class": "VERSION", "protocol": 1}))
        connection.close()

    def start(now_s):
        if now_s > 3 and not path.exists():
            listener.bind(str(path))
            listener.listen()
            threading.Thread(target=greet).start()

    with listener, connect_patiently(str(path), connect, Turned(start)) as client:
        assert client.version["protocol"] == 1


class Gauges:
    """A client whose gauges are as the list says, one look after the other; the last for ever."""

    def __init__(self, looks):
        self.looks = looks

    def status(self):
        look = self.looks.pop(0) if len(self.looks) > 1 else self.looks[0]
        return {"gauges": [{"channel": f"joints.{i}", "quality": quality} for i, quality in enumerate(look, start=1)]}


def test_gauges_that_have_no_value_yet_are_waited_for(capsys):
    clock = Turned()
    wait_for_gauges(Gauges([["never_read", "never_read"], ["ok", "timeout"], ["ok", "crc"], ["ok", "ok"]]), clock)
    assert clock.now_s == pytest.approx(0.4)
    assert capsys.readouterr().err == "joints.1 and 1 more have no value yet: waiting up to 30 s\n"


def test_a_gauge_that_waits_for_a_person_is_not_waited_for(capsys):
    wait_for_gauges(Gauges([["ok", "distrusted"]]), Turned())
    assert capsys.readouterr().err == ""


def test_a_gauge_that_never_comes_is_left_to_the_daemon_to_name():
    clock = Turned()
    wait_for_gauges(Gauges([["ok", "line_lost"]]), clock)
    assert PATIENCE_S <= clock.now_s < PATIENCE_S + 1
