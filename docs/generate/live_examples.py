"""Messages as they went over the socket of a daemon on the simulated tripod. This module is no page."""

from __future__ import annotations

import contextlib
import json
import socket
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from io import BufferedReader
from pathlib import Path
from typing import Any, NamedTuple

from compd.client import connect
from compd.configuration import load, shipped_configuration
from compd.demo.machine_zero import wait_for_gauges
from compd.demo.processes import Command, run_commands
from compd.live.service.requests import REQUESTS

ZERO_TRIES = 3
TIMEOUT_S = 30.0
# Messages are long; of a list or mapping of likes so many are shown.
MAX_ENTRIES = 2
MAX_TEXT = 60
Message = dict[str, Any]


class Exchange(NamedTuple):
    """What a client sent, None where it sent nothing, and what the daemon said then."""

    sent: Message | None
    received: tuple[Message, ...]


class Connection:
    """A connection to the daemon's Unix socket; it shows every message, and interprets none."""

    def __init__(self, connection: socket.socket) -> None:
        self._connection = connection
        self._lines: BufferedReader = connection.makefile("rb")

    def ask(self, message: Message, *answers: str) -> Exchange:
        """Send a message and collect the first of each of these classes, in this order."""
        self._connection.sendall(json.dumps(message).encode() + b"\n")
        return Exchange(message, tuple(self.next(name) for name in answers))

    def next(self, name: str) -> Message:
        """The next message of this class; what comes before it is passed over."""
        message = next(message for message in self._messages() if message["class"] in (name, "ERROR"))
        if message["class"] != name:
            raise RuntimeError(f"the daemon refused to send {name}: {message['text']}")
        return message

    def next_setpoint(self, *states: str) -> Message:
        """The next setpoint in one of these states."""
        return next(message for message in self._messages() if message.get("state") in states)

    def _messages(self) -> Iterator[Message]:
        """Every message that comes; raises TimeoutError where what is waited for does not come in time."""
        end_s = time.monotonic() + TIMEOUT_S
        for line in self._lines:
            if time.monotonic() > end_s:
                raise TimeoutError(f"only other messages came in {TIMEOUT_S:g} s, the last: {line!r}")
            yield json.loads(line)


@cache
def exchanges() -> Mapping[str, Exchange]:
    """One exchange for every request, by its class, and one each for VERSION unsolicited, SETPOINT, ORDER and
    ERROR.
    """
    with tempfile.TemporaryDirectory(prefix="compd-") as temporary:
        directory = Path(temporary)
        tripod = shipped_configuration("tripod-cmm.yaml")
        address = str(directory / "compd.sock")
        simulate = ["sim", "run", str(tripod), "--directory", temporary, "--zero-hold", "600"]
        commands = [
            Command(simulate, ready=directory / "control.sock"),
            Command(["run", str(directory / tripod.name)], ready=Path(address)),
        ]
        with run_commands(commands, directory / "log.txt"), contextlib.ExitStack() as stack:
            assert load(directory / tripod.name).sockets.unix.path == address
            # machine zero is refused while a gauge has not been read
            with connect(address) as observer, connect(address) as daemon:
                wait_for_gauges(observer, daemon.watch(10.0))
            client, other = (Connection(stack.enter_context(_connected(address))) for _ in range(2))
            return _talk(client, other)


def _connected(address: str) -> socket.socket:
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    connection.settimeout(TIMEOUT_S)
    connection.connect(address)
    return connection


def _zero(client: Connection) -> Exchange:
    """Machine zero; on a busy computer a line may be late for a moment."""
    for _ in range(ZERO_TRIES - 1):
        with contextlib.suppress(RuntimeError):
            return client.ask({"class": "ZERO"}, "ZERO")
    return client.ask({"class": "ZERO"}, "ZERO")


def _talk(client: Connection, other: Connection) -> Mapping[str, Exchange]:
    greeting = client.next("VERSION")
    client.ask({"class": "WATCH"})
    zero = _zero(client)
    setpoint = client.next_setpoint("ok")
    client.ask({"class": "WATCH", "rate_hz": 0}, "WATCH")
    tip_mm = [round(number, 1) + 0.0 for number in setpoint["tip_B0_mm"]]
    target = client.ask({"class": "TARGET", "tip_B0_mm": tip_mm, "id": 1})
    watch = client.ask({"class": "WATCH", "rate_hz": 10}, "WATCH")
    driven = client.next_setpoint("ok", "slewing")
    # the answer to WATCH says that the target before it has been heard
    refused = other.ask({"class": "TARGET", "tip_B0_mm": [0.0, 0.0, -500.0]}, "ERROR")
    client.ask({"class": "WATCH", "rate_hz": 0}, "WATCH")
    authorized = client.ask({"class": "AUTH", "token": "hvNhV6l3Zk3lY0cJ4lV5Wg"}, "VERSION")
    talk = {
        "greeting": Exchange(None, (greeting,)),
        "WATCH": watch,
        "SETPOINT": Exchange(None, (setpoint,)),
        "TARGET": Exchange(target.sent, (driven,)),
        "ERROR": refused,
        "RELEASE": client.ask({"class": "RELEASE"}, "RELEASE"),
        "ZERO": zero,
        "ACCEPT": client.ask({"class": "ACCEPT", "gauge": "all"}, "ACCEPT"),
        "POLL": client.ask({"class": "POLL", "gauge": "scale_1"}, "POLL"),
        # this daemon wants no token; one that does greets with AUTH
        "AUTH": Exchange(authorized.sent, ({"class": "AUTH"}, *authorized.received)),
        "STATUS": client.ask({"class": "STATUS"}, "STATUS"),
        "VERSION": client.ask({"class": "VERSION"}, "VERSION"),
        "MODEL": client.ask({"class": "MODEL"}, "MODEL"),
        "READINGS": client.ask({"class": "WATCH", "what": "readings", "rate_hz": 1}, "WATCH", "READINGS"),
    }
    other.ask({"class": "POLL", "gauge": "scale_1", "by": "anna, night shift"}, "POLL")
    talk["ORDER"] = Exchange(None, (client.next("ORDER"),))
    # a request with no part in this talk is asked as it is, without keys
    answers = {name: kind.reply.wire_name for name, kind in REQUESTS.items() if kind.reply and name not in talk}
    return talk | {name: other.ask({"class": name}, answer) for name, answer in answers.items()}


def shown(message: Message, left_out: Sequence[str] = ()) -> str:
    """A message as JSON over several lines, long lists and texts cut short: the daemon sends one line.

    left_out : keys of which only the number of keys in them is shown.
    """
    short = {key: {"...": f"{len(part)} keys"} if key in left_out else part for key, part in message.items()}
    return _lines(_shortened(short), "")


def _shortened(value: Any) -> Any:
    if isinstance(value, dict):
        short = {key: _shortened(part) for key, part in value.items()}
        if len(short) > MAX_ENTRIES + 1 and len({type(part) for part in value.values()}) == 1 and "class" not in value:
            return {**dict(list(short.items())[:MAX_ENTRIES]), "...": f"{len(short) - MAX_ENTRIES} more"}
        return short
    if isinstance(value, list):
        short_list = [_shortened(part) for part in value]
        if len(short_list) > MAX_ENTRIES + 3:
            return [*short_list[:MAX_ENTRIES], f"... {len(short_list) - MAX_ENTRIES} more"]
        return short_list
    return value[:MAX_TEXT] + "..." if isinstance(value, str) and len(value) > MAX_TEXT else value


def _lines(value: Any, indent: str) -> str:
    """JSON with a line for every key, and whatever is short on one line."""
    flat = json.dumps(value, ensure_ascii=False)
    if len(flat) + len(indent) <= 100 and (not isinstance(value, dict) or "class" not in value or len(value) < 4):
        return flat
    if isinstance(value, dict):
        inside = [f"{indent}  {json.dumps(key)}: {_lines(part, indent + '  ')}" for key, part in value.items()]
        return "{\n" + ",\n".join(inside) + f"\n{indent}}}"
    if isinstance(value, list):
        inside = [f"{indent}  {_lines(part, indent + '  ')}" for part in value]
        return "[\n" + ",\n".join(inside) + f"\n{indent}]"
    return flat
