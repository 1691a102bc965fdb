"""The protocol over real sockets: every message, every error, and nobody harmed by another's."""

from __future__ import annotations

import json
import math
import socket
import threading
from contextlib import closing

import numpy as np
import pytest

from compd.clock import MonotonicClock
from compd.configuration.operation import SocketSettings
from compd.errors import DaemonError, Problem, StateError
from compd.live.loop.commands import Commands
from compd.live.loop.sent_cycle import SentSetpoint
from compd.live.loop.setpoint import Setpoint, SetpointValues
from compd.live.loop.states import Mode, State
from compd.live.memory.shared_ring import ENTRIES, SharedRing
from compd.live.service.listeners import Listeners
from compd.live.service.messages import MAX_LINE_BYTES, line
from compd.live.service.publisher import Publisher
from compd.live.service.requests import REQUESTS, Asker, Requests, TargetKeys

PERIOD_S = 0.005
TIMEOUT_S = 20
VERSION = {"class": "VERSION", "protocol": 1, "release": "1", "machine": "test", "config_hash": "00"}
NO_ZERO = StateError(Problem(where="zero", what="none"))


def setpoint(seq: int, time_s: float | None = None) -> Setpoint:
    three = np.array([1.0, 2.0, 3.0])
    numbers = SetpointValues(
        three, three, None, three, three, three, three, three, three, {"joints": three, "frame": three}
    )
    time_s = seq * PERIOD_S if time_s is None else time_s
    return Setpoint(seq, time_s, time_s + 0.1, 0.01, State.OK, "", Mode.CMM, numbers)


class Peer:
    """A client made of a socket and nothing else."""

    def __init__(self, family, address, receive_buffer=None):
        self.socket = socket.socket(family, socket.SOCK_STREAM)
        if receive_buffer:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer)
        self.socket.settimeout(TIMEOUT_S)
        self.socket.connect(address)
        self.file = self.socket.makefile("rb")
        self.version = self.read()

    def send(self, message):
        self.socket.sendall(message if isinstance(message, bytes) else json.dumps(message).encode() + b"\n")

    def read(self):
        received = self.file.readline()
        assert received.endswith(b"\n"), f"closed after {received!r}"
        return json.loads(received)

    def ask(self, message):
        self.send(message)
        return self.read()

    def close(self):
        self.file.close()
        self.socket.close()


class LoopIsWell:
    """In the place of the watch: the setpoints of these tests have times of their own."""

    limit_s = 1.0

    def admits(self, seq, time_s):
        return True

    def wait_s(self, now_s):
        return self.limit_s

    def missing(self, now_s):
        return None

    def stop(self, now_s, reason):
        return Setpoint(10**6, now_s, now_s, math.nan, State.STOP, reason, Mode.CMM, None)


class Service:
    """A publisher on real sockets, with the loop's side in the test's hands."""

    def __init__(self, directory, target_keys):
        self.path = directory / "s" / "compd.sock"
        sockets = SocketSettings(tcp={"port": 0}, unix={"path": str(self.path)}, valid_for_s=0.1)
        self.commands = Commands(NO_ZERO)
        self.observed = []
        self.zeros = []
        self.models = []
        self.listeners = Listeners(sockets)
        self.ring = SharedRing()
        self.publisher = Publisher(
            self.listeners, self.ring, SharedRing(), LoopIsWell(), PERIOD_S, MonotonicClock(), [self.observed.append]
        )
        requests = Requests(
            VERSION,
            target_keys,
            self.commands,
            lambda: {"class": "STATUS"},
            self.zeros.append,
            switch_model=lambda *arguments: self.models.append(arguments),
        )
        self.stopping = threading.Event()
        self.thread = threading.Thread(target=self.run, args=(requests,))
        self.thread.start()
        self.peers = []

    def run(self, requests):
        self.publisher.run(requests, lambda: not self.stopping.is_set(), lambda: None)
        self.publisher.end("the test is over")

    def deliver(self, setpoint):
        self.ring.put(setpoint.time_s, setpoint.state.code, SentSetpoint.of(setpoint, None).pack())

    def unix(self, **options):
        return self._peer(Peer(socket.AF_UNIX, str(self.path), **options))

    def tcp(self, **options):
        return self._peer(Peer(socket.AF_INET, ("127.0.0.1", self.listeners.tcp_port), **options))

    def _peer(self, peer):
        self.peers.append(peer)
        return peer

    def close(self):
        for peer in self.peers:
            peer.close()
        self.stopping.set()
        self.ring.wake_reader()
        self.thread.join()
        self.listeners.close()


@pytest.fixture
def service(tmp_path):
    with closing(Service(tmp_path, TargetKeys("tip_B0_mm", rotation=False))) as service:
        yield service


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
        ({"class": "TARGET", "tip_P_mm": [1, 2, 3]}, "TARGET: unknown key 'tip_P_mm', allowed: tip_B0_mm"),
        ({"class": "MODEL", "shadow": True}, "needs file, a text (shadow: true or false)"),
        ({"class": "MODEL", "file": "m.yaml"}, "file is 'm.yaml', allowed: an absolute path, or \"\" for none"),
        ({"class": "MODEL", "file": "/m\0"}, "file is '/m\\x00', allowed: an absolute path, or \"\" for none"),
        ({"class": "MODEL", "file": "/\ud800"}, "file is '/\\ud800', allowed: an absolute path, or \"\" for none"),
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
    assert [(file, shadow) for file, shadow, _ in service.models] == [("/m.yaml", True), ("", False)]


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


def test_the_first_client_with_a_target_is_the_controller_until_it_releases(service):
    first, second = service.tcp(), service.unix()
    target = {"class": "TARGET", "tip_B0_mm": [1, 2.5, -510]}
    first.send(target)
    assert first.ask({"class": "STATUS"})["class"] == "STATUS"
    assert service.commands.target is not None
    assert service.commands.target.tip_mm == (1.0, 2.5, -510.0)
    assert second.ask(target)["code"] == "role_taken"
    assert second.ask({"class": "RELEASE"})["code"] == "not_controller"
    assert first.ask({"class": "RELEASE"}) == {"class": "RELEASE"}
    assert service.commands.target is None
    second.send(target)
    second.ask({"class": "STATUS"})
    assert service.commands.target is not None


def test_a_controller_that_goes_leaves_cmm_mode_behind(service):
    first, second = service.tcp(), service.tcp()
    first.send({"class": "TARGET", "tip_B0_mm": [1, 2, 3]})
    first.ask({"class": "STATUS"})
    assert service.commands.target is not None
    first.close()
    # the publisher sees the end of that stream no later than it answers the newcomer after it
    second.ask({"class": "STATUS"})
    service.tcp().ask({"class": "STATUS"})
    assert service.commands.target is None


def test_a_hexapod_and_a_tool_on_the_plate_take_their_own_targets(tmp_path):
    with closing(Service(tmp_path / "h", TargetKeys("tip_B0_mm", rotation=True))) as hexapod:
        peer = hexapod.unix()
        peer.send({"class": "TARGET", "tip_B0_mm": [1, 2, 3], "rotation_B0_rad": [0, 0.1, 0]})
        peer.ask({"class": "STATUS"})
        assert hexapod.commands.target is not None
        assert hexapod.commands.target.rotation_B0_rad == (0.0, 0.1, 0.0)
    with closing(Service(tmp_path / "p", TargetKeys("tip_P_mm", rotation=False))) as plate:
        peer = plate.unix()
        assert peer.ask({"class": "TARGET", "tip_B0_mm": [1, 2, 3]})["code"] == "bad_message"
        peer.send({"class": "TARGET", "tip_P_mm": [1, 2, 3]})
        peer.ask({"class": "STATUS"})
        assert plate.commands.target is not None


def test_zero_over_tcp_is_refused_and_over_unix_answered_when_done(service):
    assert service.tcp().ask({"class": "ZERO"})["code"] == "unix_only"
    assert service.zeros == []
    peer = service.unix()
    peer.send({"class": "ZERO"})
    assert peer.ask({"class": "STATUS"})["class"] == "STATUS", "the publisher does not wait for it"
    (answer,) = service.zeros
    threading.Thread(target=answer, args=(line({"class": "ZERO", "taken_at": "now"}),)).start()
    assert peer.read() == {"class": "ZERO", "taken_at": "now"}


def test_a_slow_client_is_dropped_and_counted_and_the_others_miss_nothing(service):
    slow, good = service.unix(), service.tcp()
    slow.ask({"class": "WATCH"})
    good.ask({"class": "WATCH"})
    now_s = MonotonicClock().monotonic()
    seq = 0
    while not service.publisher.dropped_clients:
        seq += 1
        assert seq < 50_000, "the slow client was never dropped"
        service.deliver(setpoint(seq, now_s + seq * PERIOD_S))
        assert good.read()["seq"] == seq
    assert service.publisher.summary()["dropped_setpoints"] == 0
    good.ask({"class": "STATUS"})
    assert service.publisher.summary()["clients"] == 1
    while slow.socket.recv(65536):
        pass  # what was on its way, then the end of the stream


def test_a_full_queue_drops_the_oldest_and_counts_them(service):
    peer = service.tcp()
    entered, leave = threading.Event(), threading.Event()

    def hold_up(setpoint):
        entered.set()
        assert leave.wait(TIMEOUT_S)

    service.publisher._observers = (hold_up,)
    peer.ask({"class": "WATCH"})
    now_s = MonotonicClock().monotonic()
    service.deliver(setpoint(0, now_s))
    assert entered.wait(TIMEOUT_S)
    for seq in range(1, 601):
        service.deliver(setpoint(seq, now_s + seq * PERIOD_S))
    leave.set()
    assert peer.read()["seq"] == 0
    dropped = peer.read()["seq"] - 1
    assert 600 - ENTRIES <= dropped <= 600 - ENTRIES + 20, "all but what the ring has, less a margin"
    assert service.publisher.summary()["dropped_setpoints"] == dropped


def test_beyond_the_last_seat_a_client_is_told_and_closed(service):
    seated = [service.unix() for _ in range(32)]
    extra = service.tcp()
    assert extra.version["code"] == "too_many_clients"
    assert extra.file.read() == b""
    seated[0].close()
    seated[1].ask({"class": "STATUS"})
    service.unix().ask({"class": "STATUS"})


def test_the_unix_socket_is_for_user_and_group_and_goes_with_the_daemon(tmp_path):
    service = Service(tmp_path, TargetKeys("tip_B0_mm", rotation=False))
    assert service.path.stat().st_mode & 0o777 == 0o660
    with pytest.raises(DaemonError, match="another daemon is listening"):
        Service(tmp_path, TargetKeys("tip_B0_mm", rotation=False))
    service.close()
    assert not service.path.exists()


def test_a_socket_that_a_crash_left_behind_is_replaced(tmp_path):
    path = tmp_path / "s" / "compd.sock"
    path.parent.mkdir()
    with socket.socket(socket.AF_UNIX) as crashed:
        crashed.bind(str(path))
    with closing(Service(tmp_path, TargetKeys("tip_B0_mm", rotation=False))) as service:
        assert service.unix().version == VERSION


def test_a_port_that_is_taken_is_named(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        sockets = SocketSettings(tcp={"port": port}, unix={"path": str(tmp_path / "s")}, valid_for_s=0.1)
        with pytest.raises(DaemonError, match=str(port)):
            Listeners(sockets)
