"""A controller whose computer is gone without a word: its role ends, on a real network in a namespace of its own."""

from __future__ import annotations

import fcntl
import os
import shutil
import socket
import struct
import subprocess
import sys
import termios
import threading
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest

from compd.clock import MonotonicClock
from compd.live.service import connection_limits as seats
from tests.support.patience import PATIENCE_S
from tests.support.service import Service

TOKEN = "hvNhV6l3Zk3lY0cJ4lV5Wg"
# A network of its own for each process that runs these tests.
HOST, CLIENT = (f"10.231.{os.getpid() % 256}.{number}" for number in (1, 2))

CONTROLLER = """
import socket, sys
daemon = socket.create_connection((sys.argv[1], int(sys.argv[2])))
lines = daemon.makefile("rb")
lines.readline()
daemon.sendall(b'{"class":"AUTH","token":"%s"}\\n' % sys.argv[3].encode())
lines.readline()
daemon.sendall(b'{"class":"TARGET","tip_B0_mm":[1,2,3]}\\n{"class":"VERSION"}\\n')
lines.readline()
print("controller", flush=True)
sys.stdin.read()
"""


def ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True, capture_output=True, text=True)


@pytest.fixture
def network() -> Iterator[str]:
    """A second computer as far as the kernel's network is concerned: the name of its namespace."""
    if os.geteuid() != 0 or shutil.which("ip") is None:
        pytest.skip("network namespaces need root and iproute2")
    name = f"compd{os.getpid()}"
    near, far = f"cn{os.getpid()}", f"cf{os.getpid()}"
    try:
        ip("netns", "add", name)
    except subprocess.CalledProcessError as error:
        pytest.skip(f"no network namespace can be made here: {error.stderr.strip()}")
    try:
        try:
            ip("link", "add", near, "type", "veth", "peer", "name", far, "netns", name)
        except subprocess.CalledProcessError as error:
            pytest.skip(f"no pair of network interfaces can be made here: {error.stderr.strip()}")
        ip("addr", "add", f"{HOST}/30", "dev", near)
        ip("link", "set", near, "up")
        ip("-n", name, "addr", "add", f"{CLIENT}/30", "dev", far)
        ip("-n", name, "link", "set", far, "up")
        yield name
    finally:
        ip("netns", "del", name)


def until(happened: Callable[[], bool]) -> bool:
    """Whether it has happened within PATIENCE_S."""
    clock = MonotonicClock()
    end_s = clock.monotonic() + PATIENCE_S
    while not happened() and clock.monotonic() < end_s:
        clock.wait(threading.Event(), 0.05)
    return happened()


def unacknowledged_bytes(service: Service) -> int:
    """What the service has sent to its one client and the client's computer has not yet confirmed, tcp(7), SIOCOUTQ."""
    (session,) = service.publisher._sessions
    (count,) = struct.unpack("i", fcntl.ioctl(session.connection, termios.TIOCOUTQ, struct.pack("i", 0)))
    return int(count)


def test_a_controller_whose_computer_has_lost_its_network_loses_the_role(
    network: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for option, value in ((socket.TCP_KEEPIDLE, 1), (socket.TCP_KEEPINTVL, 1), (socket.TCP_USER_TIMEOUT, 2000)):
        assert (socket.IPPROTO_TCP, option) in seats.KEEPALIVE
        monkeypatch.setitem(seats.KEEPALIVE, (socket.IPPROTO_TCP, option), value)
    (tmp_path / "token").write_text(TOKEN)
    (tmp_path / "token").chmod(0o600)
    tcp = {"host": HOST, "allow": [f"{CLIENT}/32"], "token_file": str(tmp_path / "token")}
    with closing(Service(tmp_path, tcp=tcp)) as service:
        command = ["ip", "netns", "exec", network, sys.executable, "-c", CONTROLLER]
        with subprocess.Popen(
            [*command, HOST, str(service.listeners.tcp_port), TOKEN],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        ) as controller:
            assert controller.stdout is not None
            try:
                assert controller.stdout.readline() == "controller\n"
                assert service.commands.target is not None
                # only then it is the question after a silent peer that counts, and not one for bytes on their way
                assert until(lambda: unacknowledged_bytes(service) == 0)
                ip("-n", network, "addr", "flush", "dev", f"cf{os.getpid()}")  # nothing answers, nothing says so
                assert until(lambda: service.commands.target is None)
            finally:
                controller.kill()
        assert service.unix().ask({"class": "STATUS"}) == {"class": "STATUS"}
