"""Replies of an unknown gauge, from a file or from the wire."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from compd.clock import MonotonicClock
from compd.errors import CompdError
from compd.gauge import LineFault, Quality
from compd.gauge_tools import open_tapped_stream
from compd.line_settings import PolledLineSettings
from compd.lines import StreamLine

MAX_REPLY = 1024
# Line ends of devices: CR, LF, ETX, EOT.
LINE_ENDS = b"\r\n\x03\x04"


class CapturedReply(NamedTuple):
    """A request (b"" for unsolicited data) and the reply."""

    request: bytes
    reply: bytes


def read_capture(path: Path) -> list[CapturedReply]:
    """The replies of a capture: lines of `>` (sent) or `<` (received), then hex or quoted text.

    Each reply belongs to the last request before it. `#` begins a comment. CompdError names file and line of what
    cannot be read.
    """
    request, captured = b"", []
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        why = error.strerror if isinstance(error, OSError) else "it is not in UTF-8"
        raise CompdError.of(str(path), f"cannot be read: {why}") from error
    for number, line in enumerate(lines, start=1):
        text = line.strip()
        if not text or text.startswith("#"):
            continue
        data = _bytes_of_line(f"{path}:{number}", text)
        if text[0] == ">":
            request = data
        else:
            captured.append(CapturedReply(request, data))
    return captured


def saved_capture(captured: Sequence[CapturedReply]) -> Path:
    """A new file, among the system's temporary ones, that `read_capture` reads as `captured`."""
    lines = []
    for request, reply in captured:
        lines += [f"> {request.hex(' ')}"] if request else []
        lines.append(f"< {reply.hex(' ')}")
    with tempfile.NamedTemporaryFile("w", prefix="compd-capture-", suffix=".txt", delete=False) as file:
        file.write("\n".join([*lines, ""]))
    return Path(file.name)


def _bytes_of_line(where: str, text: str) -> bytes:
    data = text[1:].strip()
    if text[0] not in "<>" or not data:
        raise CompdError.of(where, "is neither sent nor received", allowed="> hex, < hex, or quoted text, # comment")
    try:
        if data[0] in "\"'":
            return unescaped(data[1:-1])
        return bytes.fromhex(data)
    except ValueError as error:
        raise CompdError.of(where, f"cannot be read: {error}", allowed='3F 0D, or "?\\r"') from error


def unescaped(text: str) -> bytes:
    r"""Bytes for text with \r \n \t \\ and \xHH; ValueError for anything else."""
    return text.encode("latin-1").decode("unicode_escape").encode("latin-1")


def capture_live(
    settings: PolledLineSettings,
    out: str,
    wanted: int,
    between: Callable[[int, int], None],
    show: Callable[[str], None],
) -> list[CapturedReply]:
    """`wanted` replies, captured on the wire.

    out : the request with escapes: everything until silence is its reply. "" for unsolicited data, whose
        whole lines are replies, each the first that begins after `between`.
    between : called between two captures with (captured so far, wanted): the person moves the gauge meanwhile.
    show : called with a line of text for all bytes that pass.
    Raises CompdError when nothing comes.
    """
    request = unescaped(out)
    captured: list[CapturedReply] = []

    def show_bytes(direction: str, data: bytes) -> None:
        show(f"{direction} {data.hex(' ')}   {data!r}")

    try:
        line = open_tapped_stream(settings, MonotonicClock(), show_bytes)
        try:
            while len(captured) < wanted:
                reply = _reply_until_silence(line, request) if request else _line_unsolicited(line)
                captured.append(CapturedReply(request, reply))
                if len(captured) < wanted:
                    between(len(captured), wanted)
        finally:
            line.close()
    except LineFault as fault:
        hint = "--timeout longer than the period of unsolicited readings, or --out with the device's request"
        raise CompdError.of(
            str(getattr(settings, "port", settings)),
            f"reply {len(captured) + 1}: {fault}",
            next_step="check port, baud, format" + (", request and its terminator" if request else f"; {hint}"),
        ) from fault
    return captured


def _reply_until_silence(line: StreamLine, request: bytes) -> bytes:
    """The reply to a request, until the line is quiet. Raises LineFault: TIMEOUT without a reply."""
    line.send(request)
    reply = b""
    while len(reply) < MAX_REPLY:
        try:
            reply += line.receive(1)
        except LineFault as fault:
            if fault.quality is not Quality.TIMEOUT or not reply:
                raise
            return reply
    raise LineFault(Quality.MISMATCH, f"no silence within {MAX_REPLY} bytes: leave out --out for unsolicited readings")


def _line_unsolicited(line: StreamLine) -> bytes:
    """The first whole line of a device that sends unsolicited readings: up to its terminator, or between two silences.

    Raises LineFault: TIMEOUT when nothing comes, MISMATCH for bytes without an end.
    """
    line.listen()
    text, from_its_beginning = b"", False
    for _ in range(2 * MAX_REPLY):
        try:
            byte = line.receive(1)
        except LineFault as fault:
            if fault.quality is not Quality.TIMEOUT or (from_its_beginning and not text):
                raise
            byte = b""
        if byte and (not text or byte in LINE_ENDS or text[-1:] not in LINE_ENDS):
            text += byte
            continue
        # a byte behind a terminator, or a silence, ends a line
        if from_its_beginning:
            return text
        text, from_its_beginning = byte, True
    raise LineFault(Quality.MISMATCH, f"no end of a line within {2 * MAX_REPLY} bytes")
