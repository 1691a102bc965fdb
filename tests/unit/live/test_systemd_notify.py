"""sd_notify over a real datagram socket."""

from __future__ import annotations

import os
import socket

import pytest

from compd.live.system.systemd import Notifier


@pytest.fixture
def manager(tmp_path):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        manager.setblocking(False)
        yield manager


def heard(manager):
    messages = []
    while True:
        try:
            messages.append(manager.recv(4096).decode())
        except BlockingIOError:
            return messages


def test_ready_status_and_stopping_are_what_systemd_expects(manager):
    notifier = Notifier.from_environment({"NOTIFY_SOCKET": manager.getsockname()})
    notifier.ready()
    notifier.status("hold: joint 4\nlost")
    notifier.beat(1.0)  # no watchdog was asked for
    notifier.stopping()
    notifier.close()
    assert heard(manager) == ["READY=1", "STATUS=hold: joint 4 lost", "STOPPING=1"]


def test_the_watchdog_is_fed_four_times_an_interval_however_often_the_loop_turns(manager):
    environment = {"NOTIFY_SOCKET": manager.getsockname(), "WATCHDOG_USEC": "2000000", "WATCHDOG_PID": str(os.getpid())}
    notifier = Notifier.from_environment(environment)
    for tick in range(2 * 128 + 1):  # two seconds at 128 Hz
        notifier.beat(100.0 + tick / 128)
    notifier.close()
    assert heard(manager) == ["WATCHDOG=1"] * 5


def test_a_watchdog_for_another_process_is_not_fed(manager):
    environment = {"NOTIFY_SOCKET": manager.getsockname(), "WATCHDOG_USEC": "2000000", "WATCHDOG_PID": "1"}
    notifier = Notifier.from_environment(environment)
    notifier.beat(100.0)
    notifier.close()
    assert heard(manager) == []


def test_an_abstract_address_works():
    name = f"compd-test-{os.getpid()}"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind("\0" + name)
        manager.setblocking(False)
        notifier = Notifier("@" + name)
        notifier.ready()
        notifier.close()
        assert heard(manager) == ["READY=1"]


def test_without_systemd_or_after_it_went_nothing_happens(tmp_path):
    silent = Notifier.from_environment({})
    silent.ready()
    silent.beat(1.0)
    silent.close()
    gone = Notifier(str(tmp_path / "nobody"), watchdog_s=1.0)
    gone.beat(1.0)
    gone.close()


def test_a_manager_that_does_not_read_is_not_waited_for(manager):
    notifier = Notifier(manager.getsockname(), watchdog_s=4.0)
    for second in range(5000):
        notifier.beat(float(second))
    notifier.close()
    assert 0 < len(heard(manager)) < 5000, "the test is void unless the socket was full"
