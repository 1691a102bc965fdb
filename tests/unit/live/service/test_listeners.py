"""The sockets that the daemon listens on: nothing is replaced that is not its own."""

from __future__ import annotations

import os
import socket
from contextlib import closing

import pytest

from compd.errors import DaemonError
from compd.live.service.listeners import Listeners
from compd.operation_settings import SocketSettings
from tests.support.service import TARGET_KEYS, VERSION, Service


def test_the_unix_socket_is_for_user_and_group_and_goes_with_the_daemon(tmp_path):
    service = Service(tmp_path, TARGET_KEYS)
    assert service.path.stat().st_mode & 0o777 == 0o660
    with pytest.raises(DaemonError, match="another daemon is listening"):
        Service(tmp_path, TARGET_KEYS)
    service.close()
    assert not service.path.exists()


def test_a_socket_that_a_crash_left_behind_is_replaced(tmp_path):
    path = tmp_path / "s" / "compd.sock"
    path.parent.mkdir()
    with socket.socket(socket.AF_UNIX) as crashed:
        crashed.bind(str(path))
    with closing(Service(tmp_path, TARGET_KEYS)) as service:
        assert service.unix().version == VERSION


def test_a_port_that_is_taken_is_named(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        sockets = SocketSettings(tcp={"port": port}, unix={"path": str(tmp_path / "s")}, valid_for_s=0.1)
        with pytest.raises(DaemonError, match=str(port)):
            Listeners(sockets)


@pytest.mark.parametrize("make", [lambda path: path.write_text("precious"), os.mkdir, os.mkfifo])
@pytest.mark.parametrize("name", ["compd.sock", ".compd.sock.new"])
def test_what_is_not_a_socket_is_neither_replaced_nor_removed(tmp_path, make, name):
    path = tmp_path / "s" / name
    path.parent.mkdir()
    make(path)
    before = path.lstat()
    with pytest.raises(DaemonError, match="a file of another kind"):
        Service(tmp_path)
    assert path.lstat() == before


def test_a_symbolic_link_is_not_followed_to_somebody_elses_file(tmp_path):
    path = tmp_path / "s" / "compd.sock"
    path.parent.mkdir()
    path.symlink_to(tmp_path / "elsewhere")
    with pytest.raises(DaemonError, match="a file of another kind"):
        Service(tmp_path)


def test_what_has_taken_the_sockets_place_meanwhile_is_left_alone_at_the_end(tmp_path):
    service = Service(tmp_path)
    service.path.unlink()
    service.path.write_text("precious")
    service.close()
    assert service.path.read_text() == "precious"
