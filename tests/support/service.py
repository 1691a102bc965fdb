"""A publisher on real sockets, and clients made of a socket and nothing else."""

from __future__ import annotations

import json
import math
import socket
import threading

import numpy as np

from compd.compensation import Compensation
from compd.compensation.values import Contributions
from compd.errors import StateError
from compd.live.loop import Commands, Setpoint
from compd.live.memory import PollRequests, SharedRing
from compd.live.service import Errands, Listeners, Messages, Publisher, RequestContext, Requests, TargetKeys, TcpAccess
from compd.live.service.messages import line
from compd.model.kinematics import Frame
from compd.operation_settings import SocketSettings
from compd.setpoint_states import Mode, State
from tests.support.hand_clock import SteppedClock
from tests.support.patience import PATIENCE_S

PERIOD_S = 0.005
TARGET_KEYS = TargetKeys("tip_B0_mm", rotation=False)
VERSION = {"class": "VERSION", "protocol": 1, "release": "1", "machine": "test", "config_hash": "00"}
NO_ZERO = StateError.of("zero", "none")


def setpoint(seq: int, time_s: float | None = None) -> Setpoint:
    three = np.array([1.0, 2.0, 3.0])
    contributions = Contributions(("joints", "frame"), np.array([three, three]))
    frame = Frame(three, three, three, three, three, three, *(np.array(0),) * 3)
    numbers = Compensation(*(three,) * 4, frame, *(three,) * 5, contributions, np.array(0))
    time_s = seq * PERIOD_S if time_s is None else time_s
    return Setpoint(seq, time_s, time_s + 0.1, 0.01, State.OK, "", Mode.CMM, numbers)


class Peer:
    """A client made of a socket and nothing else."""

    def __init__(self, family, address, receive_buffer=None, token=None):
        self.socket = socket.socket(family, socket.SOCK_STREAM)
        if receive_buffer:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer)
        self.socket.settimeout(PATIENCE_S)
        self.socket.connect(address)
        self.file = self.socket.makefile("rb")
        try:
            self.version = self.read()
            if token is not None:
                self.version = self.ask({"class": "AUTH", "token": token})
        except AssertionError:
            self.close()
            raise

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

    def __init__(self, directory, target_keys=TARGET_KEYS, tcp=None, target=None):
        """`tcp`, `target`: keys of the configuration's sections of these names."""
        self.path = directory / "s" / "compd.sock"
        sockets = SocketSettings(
            tcp={"port": 0, **(tcp or {})}, unix={"path": str(self.path)}, valid_for_s=0.1, target=target or {}
        )
        self.clock = SteppedClock()
        self.commands = Commands(NO_ZERO)
        self.observed = []
        self.zeros = []
        self.models = []
        self.distrusted = {"scale_1": ["scale_1.position"], "joints": ["joints.1", "joints.2"]}
        self.poll_requests = PollRequests(["scale_1"])
        self.listeners = Listeners(sockets)
        self.ring = SharedRing()
        self.publisher = Publisher(
            listeners=self.listeners,
            setpoints=self.ring,
            cycles=SharedRing(),
            watch=LoopIsWell(),
            period_s=PERIOD_S,
            system=self.clock,
            observers=[self.observed.append],
        )
        self.requests = Requests(
            RequestContext(
                messages=Messages(
                    version=VERSION,
                    machine={"class": "MACHINE"},
                    status=self.status,
                    budget=lambda: {"class": "BUDGET"},
                ),
                errands=Errands(
                    take_zero=lambda replace, answer: self.zeros.append((replace, answer)),
                    switch_model=lambda *arguments: self.models.append(arguments),
                    accept=self.accept,
                    poll=self.poll_requests.add,
                    tell_order=self.publisher.tell_order,
                ),
                commands=self.commands,
                target_keys=target_keys,
                targets=sockets.target,
                access=TcpAccess.of(sockets.tcp),
                clock=self.clock,
            )
        )
        self.stopping = threading.Event()
        self.thread = threading.Thread(target=self.run, args=(self.requests,))
        self.thread.start()
        self.peers = []

    def run(self, requests):
        self.publisher.run(requests, lambda: not self.stopping.is_set(), lambda: None)
        self.publisher.end("the test is over")

    def status(self):
        return {"class": "STATUS"}

    def accept(self, gauge, answer):
        """In the place of the acquisition: believes the gauges of `distrusted` again."""
        if gauge != "all" and gauge not in self.distrusted:
            raise ValueError(f"no gauge {gauge}; there are {', '.join(self.distrusted)}")
        names = list(self.distrusted) if gauge == "all" else [gauge]
        channels = [channel for name in names for channel in self.distrusted.pop(name)]
        answer(line({"class": "ACCEPT", "gauges": channels}))

    def pass_time(self, step_s):
        """Let time pass, and the publisher look at what is overdue."""
        self.clock.step(step_s)
        self.ring.wake_reader()

    def deliver(self, setpoint):
        _, content = setpoint.pack(None)
        self.ring.put(setpoint.time_s, setpoint.state.code, content)

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
