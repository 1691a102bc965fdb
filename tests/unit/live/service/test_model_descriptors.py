"""Model files over the Unix socket: the client opens them, and the daemon reads the descriptor that it sends."""

from __future__ import annotations

import contextlib
import json
import os
import socket
import struct
import threading
from dataclasses import replace
from pathlib import Path

import pytest

from compd.client import connect
from compd.errors import DaemonError
from compd.live.memory.control import Control
from compd.live.service import descriptor_bin, model_switch
from compd.live.service.client_session import ClientSession
from compd.live.service.descriptor_bin import DescriptorBin
from compd.live.service.messages import ProtocolError
from compd.live.service.model_switch import ModelSwitch, ModelWish
from compd.live.system import THIS_COMPUTER
from tests.support.hand_clock import SteppedClock
from tests.support.patience import PATIENCE_S

TEXT = b"format: 1\n"


def open_descriptors():
    return sum(1 for _ in Path("/proc/self/fd").iterdir())


class Pair:
    """A session and the client's end of its socket."""

    def __init__(self):
        ours, self.client = socket.socketpair(socket.AF_UNIX)
        self.bin = DescriptorBin(THIS_COMPUTER)
        self.session = ClientSession(ours, "unix", local=True, unwanted=self.bin)

    def send(self, content, *descriptors):
        if descriptors:
            socket.send_fds(self.client, [content], descriptors)
        else:
            self.client.sendall(content)

    def lines(self):
        """What has arrived: each line, and whether a descriptor came with it."""
        self.session.receive(0.0)
        found = []
        while self.session.has_lines:
            line = self.session.next_line()
            descriptor = self.session.take_descriptor()
            found.append((line if isinstance(line, bytes) else "error", descriptor is not None))
            if descriptor is not None:
                os.close(descriptor)
        return found

    def close(self):
        self.session.close()
        self.client.close()


@pytest.fixture
def pair():
    pair = Pair()
    yield pair
    pair.close()


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "m.yaml"
    path.write_bytes(TEXT)
    descriptor = os.open(path, os.O_RDONLY)
    yield descriptor
    os.close(descriptor)


def test_a_descriptor_belongs_to_the_line_that_came_with_it(pair, file):
    pair.send(b"a\n")
    pair.send(b"b\n", file)
    pair.send(b"c\n")
    assert pair.lines() == [(b"a", False), (b"b", True)], "the system gives the rest later"
    assert pair.lines() == [(b"c", False)]


def test_a_line_in_two_pieces_keeps_the_descriptor_of_its_first(pair, file):
    pair.send(b"begin", file)
    assert pair.lines() == []
    pair.send(b"-end\nnext\n")
    assert pair.lines() == [(b"begin-end", True), (b"next", False)]


def test_descriptors_are_inherited_by_no_process(pair, file):
    pair.send(b"a\n", file)
    pair.session.receive(0.0)
    pair.session.next_line()
    descriptor = pair.session.take_descriptor()
    assert not os.get_inheritable(descriptor)
    os.close(descriptor)


def test_ten_thousand_lines_with_descriptors_leave_none_open(pair, file):
    pair.send(b"first\n", file)
    pair.lines()
    before = open_descriptors()
    for number in range(10_000):
        match number % 5:
            case 0:
                pair.send(b'{"class":"STATUS"}\n', file)
            case 1:
                pair.send(b"\n", file, file, file)
            case 2:
                pair.send(b"half", file)
                pair.session.receive(0.0)
                pair.send(b" a line\n", file)
            case 3:
                pair.send(b"x" * 5000 + b"\n", file)
            case 4:
                pair.send(b"two\nlines\n", file)
        while True:
            while pair.bin.is_full:
                pass
            pair.session.receive(0.0)
            if not pair.session.has_lines:
                break
            while pair.session.has_lines:
                pair.session.next_line()
            pair.session.end_line()
            if number % 5 != 3:
                break
    pair.session.end_line()
    while not pair.bin._waiting.empty():
        pass
    assert open_descriptors() <= before + 1, "the last may be in the hands of the thread that closes"


def test_what_waits_when_a_client_goes_is_closed(file):
    before = open_descriptors()
    pair = Pair()
    pair.send(b"a\n", file)
    pair.session.receive(0.0)
    pair.send(b"b", file)
    pair.session.receive(0.0)
    thread_started = threading.Event()
    pair.bin.put(os.dup(file))
    thread_started.set()
    pair.close()
    while open_descriptors() > before:
        pass


def test_where_closing_hangs_no_more_descriptors_are_taken(pair, file, monkeypatch):
    """A file system in user space may let whoever closes a file wait for ever."""
    go_on = threading.Event()
    real_close = os.close
    monkeypatch.setattr(os, "close", lambda descriptor: (go_on.wait(), real_close(descriptor)))
    for _ in range(descriptor_bin.MAX_WAITING + 1):
        pair.bin.put(os.dup(file))
    while not pair.bin.is_full:
        pair.bin.put(os.dup(file))
    before = open_descriptors()
    pair.send(b"a\n")
    assert pair.lines() == [(b"a", False)], "a line without one is heard"
    pair.send(b"a\n", file)
    while pair.session.open:
        assert pair.lines() == []
    assert open_descriptors() == before
    go_on.set()


@pytest.fixture
def lingering():
    """Give away a TCP connection whose closing waits for an hour: what was sent has not been read at its other end."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        sender = socket.create_connection(server.getsockname())
        reader, _ = server.accept()
        sender.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("2i", 1, 3600))
        sender.setblocking(False)
        with contextlib.suppress(BlockingIOError):
            while True:
                sender.send(b"x" * 65536)
        with reader:
            yield sender.detach()


@pytest.mark.parametrize("comes", ["first", "second", "when the client goes", "as a model"])
def test_a_connection_that_lingers_is_waited_for_by_nobody(pair, switch, file, lingering, comes):
    if comes == "as a model":
        switch.start(ModelWish("m.yaml"), lingering)
        assert "not a regular file" in switch.read()
        return
    null = os.open(os.devnull, os.O_RDONLY)
    pair.send(b'{"class":"VERSION"}\n', *((lingering, null) if comes == "first" else (null, lingering)))
    os.close(lingering)
    os.close(null)
    if comes != "when the client goes":
        pair.session.receive(0.0)
        assert pair.session.next_line() == b'{"class":"VERSION"}'
        pair.session.end_line()
    pair.close()
    while not pair.bin._waiting.empty():
        pass


class Switch:
    """A switch whose supervisor is the test."""

    def __init__(self):
        self.control = Control()
        self.woken = threading.Event()
        self.clock = SteppedClock()
        self.switch = ModelSwitch(self.control, self.woken.set, self.clock)
        self.answers = []

    def start(self, wish, descriptor):
        self.switch.start(wish, lambda: descriptor, lambda line: self.answers.append(json.loads(line)))

    def read(self):
        """Until the file has been read: what the supervisor gets, or the refusal."""
        assert self.woken.wait(PATIENCE_S)
        self.woken.clear()
        self.switch.look()
        return self.answers[-1]["text"] if self.answers else self.control.model_request.read()

    def close(self):
        self.control.close()


@pytest.fixture
def switch():
    switch = Switch()
    yield switch
    switch.close()


def test_the_bytes_of_the_descriptor_go_to_the_next_loop_and_the_name_is_only_a_name(switch, file):
    os.lseek(file, 0, os.SEEK_END)  # the client has read it
    switch.start(ModelWish("/etc/shadow", shadow=True), os.dup(file))
    number, text, shadow, hash_ = switch.read()
    assert (number, tuple(text), shadow, hash_) == (1, ("/etc/shadow", TEXT), True, "")


def test_a_shadow_is_named_by_its_hash_and_nothing_is_read(switch):
    switch.start(ModelWish(hash="0123456789abcdef"), None)
    assert switch.control.model_request.read() == (1, None, False, "0123456789abcdef")


def test_a_name_alone_is_refused_and_says_how_it_is_done(switch, tmp_path):
    secret = tmp_path / "token"
    secret.write_text("s3cr3t")
    with pytest.raises(ProtocolError, match=r"sends? an open descriptor.*compd model adopt") as caught:
        switch.start(ModelWish(str(secret)), None)
    assert "s3cr3t" not in caught.value.text
    assert switch.control.model_request.read() is None
    switch.start(ModelWish(""), None)
    assert switch.control.model_request.read() == (1, None, False, "")


def pipe(tmp_path):
    reading, writing = os.pipe()
    os.close(writing)
    return reading


def write_only(tmp_path):
    return os.open(tmp_path / "w", os.O_WRONLY | os.O_CREAT)


def long(tmp_path):
    (tmp_path / "long").write_bytes(b"x" * 1_000_001)
    return os.open(tmp_path / "long", os.O_RDONLY)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (pipe, "not a regular file"),
        (lambda _: socket.socket().detach(), "not a regular file"),
        (lambda _: os.open("/dev/zero", os.O_RDONLY), "not a regular file"),
        (lambda path: os.open(path, os.O_RDONLY), "it is a directory"),
        (write_only, "not open for reading"),
        (lambda _: os.open("/etc/shadow", os.O_PATH), "not open for reading"),
        (long, "more than 1000000 bytes"),
    ],
    ids=["pipe", "socket", "device", "directory", "write only", "O_PATH", "long"],
)
def test_what_is_no_file_open_for_reading_is_refused_and_closed(switch, tmp_path, make, says):
    before = open_descriptors()
    switch.start(ModelWish("/m.yaml"), make(tmp_path))
    assert says in switch.read()
    assert open_descriptors() == before
    assert switch.control.model_request.read() is None


def test_a_file_without_a_name_is_what_was_written_to_it(switch):
    descriptor = os.memfd_create("m")
    os.write(descriptor, TEXT)
    switch.start(ModelWish("/m.yaml"), descriptor)
    assert switch.read()[1].content == TEXT


def test_what_the_system_makes_while_it_is_read_is_empty(switch):
    """Some files in /proc say more to root than to whoever opened them."""
    switch.start(ModelWish("/m.yaml"), os.open("/proc/self/status", os.O_RDONLY))
    assert switch.read()[1].content == b""


def test_a_file_that_is_cut_meanwhile_is_what_is_left_of_it(switch, tmp_path, monkeypatch):
    path = tmp_path / "m.yaml"
    path.write_bytes(b"x" * 1000)
    real = os.pread

    def cut(descriptor, length, offset):
        os.truncate(path, 10)
        return real(descriptor, length, offset)

    monkeypatch.setattr("compd.files.atomic_files.os.pread", cut)
    switch.start(ModelWish("/m.yaml"), os.open(path, os.O_RDONLY))
    assert switch.read()[1].content == b"x" * 10


def test_a_file_system_that_hangs_stops_nobody(switch, file, monkeypatch):
    go_on, reads = threading.Event(), []
    real = model_switch.read_descriptor

    def hang(descriptor, limit_bytes):
        reads.append(descriptor)
        go_on.wait()
        return real(descriptor, limit_bytes)

    monkeypatch.setattr(model_switch, "read_descriptor", hang)
    switch.start(ModelWish("/slow.yaml"), os.dup(file))
    with pytest.raises(ProtocolError, match="another model"):
        switch.start(ModelWish(""), None)
    switch.clock.step(model_switch.READ_WITHIN_S)
    switch.switch.look()
    assert "its file system hangs" in switch.answers[-1]["text"]
    switch.start(ModelWish(""), None)
    assert switch.control.model_request.read()[1] is None
    switch.control.model_answer.write((2, {"applied": {"effects": []}}, ""))
    switch.switch.look()
    assert switch.answers[-1]["class"] == "MODEL"
    go_on.set()
    assert switch.woken.wait(PATIENCE_S)
    switch.switch.look()
    assert len(switch.answers) == 2, "what comes too late counts no more"


def test_the_client_opens_the_file_as_itself(service, tmp_path, file):
    """The daemon's side of this test takes no wish: what reaches it is looked at here."""
    received = []

    def take(wish, descriptor, answer):
        received.append((wish, os.read(opened := descriptor(), 100)))
        os.close(opened)
        answer(b'{"class":"MODEL","applied":{"effects":[]}}\n')

    context = service.requests.context
    context.errands = replace(context.errands, switch_model=take)
    with connect(service.path, by="anna (operate) from 10.0.0.5") as client:
        for none in (tmp_path / "none.yaml", tmp_path, "/dev/zero"):
            with pytest.raises(DaemonError, match="cannot be read"):
                client.model(none)
        assert received == []
        client.model(tmp_path / "m.yaml", shadow=True)
        client.model("/a/name.yaml", descriptor=file)
    assert received == [
        (ModelWish(str(tmp_path / "m.yaml"), shadow=True), TEXT),
        (ModelWish("/a/name.yaml"), TEXT),
    ]
    with connect(f"127.0.0.1:{service.listeners.tcp_port}") as remote, pytest.raises(DaemonError, match="Unix socket"):
        remote.model(tmp_path / "m.yaml")
