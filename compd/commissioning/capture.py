"""Replies of an unknown gauge: out of a file, or from the wire."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from compd.clock import MonotonicClock
from compd.commissioning.open_gauge import open_tapped_stream
from compd.configuration.lines import ModbusRtuLine, SerialLine, TcpLine
from compd.errors import CompdError, Problem
from compd.gauge import LineFault, Quality
from compd.lines.stream import StreamLine

LONGEST_REPLY = 1024


def read_capture(path: Path) -> tuple[bytes, list[bytes]]:
    """The request and the replies of a capture: lines of `>` (sent) or `<` (received), then hex or quoted text.

    `#` begins a comment. CompdError names file and line of what cannot be read, and of a second kind of request.
    """
    request, replies = b"", []
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise CompdError(Problem(where=str(path), what=f"cannot be read: {error.strerror}")) from error
    for number, line in enumerate(lines, start=1):
        text = line.strip()
        if not text or text.startswith("#"):
            continue
        direction, data = text[0], _bytes_of_line(f"{path}:{number}", text)
        if direction == "<":
            replies.append(data)
        elif request and data != request:
            raise CompdError(
                Problem(
                    where=f"{path}:{number}",
                    what="another request than before",
                    value=repr(data),
                    allowed=repr(request),
                    next_step="learn one request at a time",
                )
            )
        else:
            request = data
    return request, replies


def _bytes_of_line(where: str, text: str) -> bytes:
    data = text[1:].strip()
    if text[0] not in "<>" or not data:
        raise CompdError(
            Problem(
                where=where,
                what="is neither sent nor received",
                value=text,
                allowed="> hex, < hex, or quoted text, # comment",
            )
        )
    try:
        if data[0] in "\"'":
            return unescaped(data[1:-1])
        return bytes.fromhex(data)
    except ValueError as error:
        raise CompdError(
            Problem(where=where, what=f"cannot be read: {error}", value=data, allowed='3F 0D, or "?\\r"')
        ) from error


def unescaped(text: str) -> bytes:
    r"""Bytes for text with \r \n \t \\ and \xHH; ValueError for anything else."""
    return text.encode("latin-1").decode("unicode_escape").encode("latin-1")


def capture_live(
    settings: SerialLine | ModbusRtuLine | TcpLine,
    out: str,
    wanted: int,
    between: Callable[[int, int], None],
    show: Callable[[str], None],
) -> tuple[bytes, list[bytes]]:
    """The request and `wanted` replies, captured on the wire: everything until silence is one reply.

    out : the request with escapes; "" for a device that speaks unasked, where a reply is what comes between two
        silences.
    between : called between two captures with (captured so far, wanted): the person moves the gauge meanwhile.
    show : called with a line of text for all bytes that pass.
    Raises CompdError when nothing comes.
    """
    request = unescaped(out)
    replies: list[bytes] = []

    def show_bytes(direction: str, data: bytes) -> None:
        show(f"{direction} {data.hex(' ')}   {data!r}")

    line = open_tapped_stream(settings, MonotonicClock(), show_bytes)
    try:
        while len(replies) < wanted:
            replies.append(_reply_until_silence(line, request))
            if len(replies) < wanted:
                between(len(replies), wanted)
    except LineFault as fault:
        raise CompdError(
            Problem(
                where=str(getattr(settings, "port", settings)),
                what=f"reply {len(replies) + 1}: {fault}",
                next_step="check port, baud, format, request and its terminator",
            )
        ) from fault
    finally:
        line.close()
    return request, replies


def _reply_until_silence(line: StreamLine, request: bytes) -> bytes:
    """What comes after a request, until the line is quiet. Raises LineFault: TIMEOUT when nothing does."""
    if request:
        line.send(request)
    else:
        line.drain()
    reply = b""
    while len(reply) < LONGEST_REPLY:
        try:
            reply += line.receive(1)
        except LineFault as fault:
            if fault.quality is not Quality.TIMEOUT or not reply:
                raise
            return reply
    raise LineFault(Quality.MISMATCH, f"no silence within {LONGEST_REPLY} bytes")
