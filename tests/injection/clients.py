"""Hostile clients: each runs in a process of its own against the daemon's sockets until it is ended."""

from __future__ import annotations

import contextlib
import json
import os
import random
import signal
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from tests.support.paths import ROOT

if TYPE_CHECKING:
    from tests.injection.machine import Machine

CONNECTED_WITHIN_S = 10.0
# Between one attack and the next: the attack is meant to last, and not to take a processor.
PAUSE_S = 0.01
# Of a controller.
TARGETS_PER_S = 2000
TARGETS_AT_ONCE = 4
BURST_S = 0.25
# nice(1): of what floods the daemon, and of a controller, whose targets would be late without processor time.
NICENESS, CONTROLLERS_NICENESS = 19, 5
RESET = struct.pack("ii", 1, 0)
Address = tuple[str, int]
BEGINS = "begins"


class Attacked(NamedTuple):
    """The daemon's sockets, and the machine's true tip in {M}, mm."""

    unix: str
    tcp: Address
    tip_mm: Sequence[float]


def _connected(tcp: Address) -> socket.socket:
    connection = socket.create_connection(tcp, CONNECTED_WITHIN_S)
    connection.settimeout(CONNECTED_WITHIN_S)
    return connection


def _flood(tcp: Address, line: bytes) -> None:
    """Ask as fast as it is taken, and read every answer."""
    with _connected(tcp) as connection:
        connection.setblocking(False)
        while True:
            with contextlib.suppress(BlockingIOError):
                connection.send(line * 100)
            with contextlib.suppress(BlockingIOError):
                while connection.recv(1 << 16):
                    pass


def status(at: Attacked) -> None:
    _flood(at.tcp, b'{"class":"STATUS"}\n')


def version(at: Attacked) -> None:
    _flood(at.tcp, b'{"class":"VERSION"}\n')


def deaf(at: Attacked) -> None:
    """Twenty watchers that never read."""
    connections = [_connected(at.tcp) for _ in range(20)]
    for connection in connections:
        connection.sendall(b'{"class":"WATCH"}\n')
    signal.pause()


def idle(at: Attacked) -> None:
    """More connections than there is room for, which ask nothing."""
    kept = []
    for _ in range(60):
        with contextlib.suppress(OSError):
            kept.append(_connected(at.tcp))
    signal.pause()


def endless(at: Attacked) -> None:
    """A line that never ends."""
    while True:
        with contextlib.suppress(OSError), _connected(at.tcp) as connection:
            while True:
                connection.sendall(b"x" * 65536)


def noise(at: Attacked) -> None:
    """Random bytes."""
    generator = random.Random(1)
    while True:
        with contextlib.suppress(OSError), _connected(at.tcp) as connection:
            while True:
                connection.sendall(generator.randbytes(4096))


def churn(at: Attacked) -> None:
    """Connections that send half a message and are reset."""
    while True:
        with contextlib.suppress(OSError), _connected(at.tcp) as connection:
            connection.sendall(b'{"class":"WATCH","rate_hz":')
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET)
        time.sleep(PAUSE_S)


def models(at: Attacked) -> None:
    """Models that are no files: a FIFO, a device without end, deep nesting."""
    folder = Path(at.unix).parent
    fifo, nested = folder / "fifo.yaml", folder / "nested.yaml"
    with contextlib.suppress(FileExistsError):
        os.mkfifo(fifo)
    nested.write_text("[" * 4000)
    while True:
        for path in (fifo, Path("/dev/zero"), nested, folder):
            with contextlib.suppress(OSError), socket.socket(socket.AF_UNIX) as connection:
                connection.settimeout(CONNECTED_WITHIN_S)
                connection.connect(at.unix)
                connection.sendall(b'{"class":"MODEL","file":"%s"}\n' % os.fsencode(path))
                lines = connection.makefile("rb")
                lines.readline()  # VERSION
                lines.readline()
        time.sleep(PAUSE_S)


def _aim(at: Attacked) -> dict[str, Any]:
    """A target where the tip is truly.

    Where a setpoint says that it is may be wrong by that setpoint's bound, and would stay so while later bounds are
    smaller.
    """
    with _connected(at.tcp) as connection:
        connection.sendall(b'{"class":"WATCH"}\n')
        for line in connection.makefile("rb"):
            message = json.loads(line)
            if message.get("valid"):
                off = zip(message["tip_B0_mm"], at.tip_mm, message["tip_M_mm"], strict=True)
                return {"class": "TARGET", "tip_B0_mm": [there + true - said for there, true, said in off]}
    raise OSError("no valid setpoint")


def _send_targets(connection: socket.socket, target: Mapping[str, Any], times_s: Iterable[float]) -> None:
    """All at once. The id of each is when it was made, us, so that a setpoint tells how old its target is."""
    lines = (json.dumps({**target, "id": round(time_s * 1e6)}).encode() + b"\n" for time_s in times_s)
    connection.sendall(b"".join(lines))


def targets(at: Attacked) -> None:
    target = _aim(at)
    with _connected(at.tcp) as connection:
        while True:
            _send_targets(connection, target, [time.monotonic()] * TARGETS_AT_ONCE)
            time.sleep(TARGETS_AT_ONCE / TARGETS_PER_S)


def target_bursts(at: Attacked) -> None:
    target = _aim(at)
    with _connected(at.tcp) as connection:
        while True:
            time.sleep(BURST_S)
            _send_targets(connection, target, _times_of_a_burst(BURST_S))


def target_burst_closed(at: Attacked) -> None:
    target = _aim(at)
    with _connected(at.tcp) as connection:
        _send_targets(connection, target, _times_of_a_burst(10 * BURST_S))
    signal.pause()


def _times_of_a_burst(stalled_s: float) -> Iterable[float]:
    """When the targets of a network that has stalled for so long were made."""
    now_s = time.monotonic()
    return (now_s - stalled_s + k / TARGETS_PER_S for k in range(1, round(stalled_s * TARGETS_PER_S) + 1))


# What is done, in a user's words and exactly, by the name of the function.
ATTACKS: dict[str, tuple[str, str]] = {
    "status": ("a client asks STATUS without end", "as fast as it is taken, over TCP"),
    "version": ("a client asks VERSION without end", "as fast as it is taken, over TCP"),
    "deaf": ("clients that watch and never read", "20 over TCP"),
    "idle": ("clients that take all places", "60 over TCP"),
    "endless": ("a client whose line never ends", "x without newline, over TCP"),
    "noise": ("a client that sends noise", "random bytes over TCP"),
    "churn": ("clients that come and are cut off", "half a message and a reset, over TCP"),
    "models": ("models that are no model files", "a FIFO, /dev/zero, 4000 brackets, a directory"),
    "targets": ("a controller that sends targets faster than the daemon computes", "2000 targets a second"),
    "target_bursts": ("a controller behind a network that stalls", "500 targets at once, four times a second"),
    "target_burst_closed": ("a controller that goes while its targets wait", "5000 targets at once, then closed"),
}
_CONTROLLERS = (targets, target_bursts, target_burst_closed)
_ATTACKS: dict[str, Callable[[Attacked], None]] = {
    function.__name__: function
    for function in (
        *(status, version, deaf, idle, endless, noise, churn, models),
        *_CONTROLLERS,
    )
}


def main(name: str, unix: str, host: str, port: str, *tip_mm: str) -> None:
    """Until it is killed; the daemon's end is its end too.

    It takes little processor time from the simulated machine: the daemon is attacked, not the computer.
    """
    print(BEGINS, flush=True)
    os.nice(CONTROLLERS_NICENESS if _ATTACKS[name] in _CONTROLLERS else NICENESS)
    with contextlib.suppress(OSError):
        _ATTACKS[name](Attacked(unix, (host, int(port)), [float(mm) for mm in tip_mm]))


def attack(name: str) -> Callable[[Machine], None]:
    """For the matrix."""
    return lambda machine: machine.attack(name)


@contextmanager
def attacking(name: str, at: Attacked) -> Iterator[None]:
    """The client runs during the block."""
    where = [at.unix, at.tcp[0], str(at.tcp[1]), *map(str, at.tip_mm)]
    command = [sys.executable, "-m", "tests.injection.clients", name, *where]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline().strip() == BEGINS, f"{name} does not begin"
            yield
        finally:
            process.kill()


if __name__ == "__main__":
    main(*sys.argv[1:])
