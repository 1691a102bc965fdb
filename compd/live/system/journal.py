"""Events as entries of systemd's journal, with a field for each key, by the journal's own protocol.

Only the service's and the supervisor's standard error leads to the journal. The other processes print an event as a
line of JSON behind a record separator (RFC 7464) into the pipe that the service relays, which limits how much a process
may log; the relay sends it on as an entry.
"""

from __future__ import annotations

import json
import os
import socket
import struct
import sys
from collections.abc import Mapping, MutableMapping
from contextlib import suppress
from typing import Any

# https://systemd.io/JOURNAL_NATIVE_PROTOCOL
_ADDRESS = "/run/systemd/journal/socket"
_IDENTIFIER = "compd"
RECORD_SEPARATOR = "\x1e"
# Of one field: the whole entry must fit into a datagram.
_MAX_FIELD = 4096
# syslog(3)
_PRIORITIES = {"debug": 7, "info": 6, "warning": 4, "error": 3, "critical": 2}


class Journal:
    """Sends entries to the journal; one that it cannot take at once is printed instead, so that nobody waits.

    A logger factory of structlog, and its logger: `render` is the last processor.
    """

    def __init__(self, stream: str, address: str = _ADDRESS) -> None:
        """`stream`: as in $JOURNAL_STREAM, "device:inode" of the standard error that leads to the journal."""
        self._stream = stream
        self._address = address

    @classmethod
    def from_environment(cls, environment: Mapping[str, str] = os.environ) -> Journal | None:
        """The journal, where standard error leads to it now; None in a terminal, in a file, in a container."""
        stream = environment.get("JOURNAL_STREAM", "")
        return cls(stream) if stream and stream == _stream_of_stderr() else None

    def __call__(self, *_: Any) -> Journal:
        return self

    @staticmethod
    def render(_logger: Any, _method: str, event: MutableMapping[str, Any]) -> tuple[tuple[Any, ...], dict[str, Any]]:
        """What a logging method of this class is called with."""
        return (dict(event),), {}

    def msg(self, event: Mapping[str, Any]) -> None:
        """Send an event, or print it where another process sends it on."""
        if _stream_of_stderr() == self._stream:
            self.send(event)
        else:
            _print(RECORD_SEPARATOR + json.dumps(event, default=str))

    debug = info = warning = error = critical = exception = log = msg

    def write(self, line: str) -> None:
        """Send on a line that another process has printed: as an entry where it is an event, else as it is."""
        if line.startswith(RECORD_SEPARATOR):
            with suppress(ValueError):  # a line that was cut
                event = json.loads(line[1:])
                if isinstance(event, dict):
                    self.send(event)
                    return
        _print(line.rstrip("\n"))

    def send(self, event: Mapping[str, Any]) -> None:
        """Send one event as an entry."""
        try:
            with socket.socket(
                socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK | socket.SOCK_CLOEXEC
            ) as sender:
                sender.sendto(entry(event), self._address)
        except OSError:
            _print(text_of(event))


def entry(event: Mapping[str, Any]) -> bytes:
    """An event in the journal's protocol: MESSAGE for people, COMPD_EVENT its name, COMPD_LINE and so on its keys."""
    fields = {
        "MESSAGE": text_of(event),
        "PRIORITY": str(_PRIORITIES.get(str(event.get("level")), 6)),
        "SYSLOG_IDENTIFIER": _IDENTIFIER,
    }
    if "id" in event:
        fields["COMPD_EVENT"] = str(event["id"])
    fields |= {_field_name(key): str(value) for key, value in event.items() if key not in _OWN_KEYS}
    return b"".join(_field(name, value) for name, value in fields.items())


# What becomes a field of another name, or is told by the journal itself.
_OWN_KEYS = ("event", "id", "level", "timestamp", "exception")


def text_of(event: Mapping[str, Any]) -> str:
    """An event in words: `line is lost: line=scale_1 detail=...`, and the traceback of an exception."""
    keys = " ".join(f"{key}={value}" for key, value in event.items() if key not in _OWN_KEYS and value != "")
    words = f"{event.get('event', '')}: {keys}" if keys else str(event.get("event", ""))
    return f"{words}\n{event['exception']}" if "exception" in event else words


def _field_name(key: str) -> str:
    """COMPD_ and the key in capitals; the journal allows capitals, digits and _."""
    return "COMPD_" + "".join(letter if letter.isascii() and letter.isalnum() else "_" for letter in key.upper())


def _field(name: str, value: str) -> bytes:
    content = value.encode(errors="replace")[:_MAX_FIELD]
    if b"\n" not in content:
        return b"%s=%s\n" % (name.encode(), content)
    return b"%s\n%s%s\n" % (name.encode(), struct.pack("<Q", len(content)), content)


def _stream_of_stderr() -> str:
    try:
        status = os.fstat(sys.stderr.fileno())
    except (OSError, ValueError):
        return ""
    return f"{status.st_dev}:{status.st_ino}"


def _print(line: str) -> None:
    sys.stderr.write(line + "\n")
    sys.stderr.flush()
