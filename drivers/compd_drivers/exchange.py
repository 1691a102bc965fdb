"""The reply to a request on a line of bytes: two timeouts, and no bytes behind the reply."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from compd.gauge import ByteLine, GaugeOptions, LineFault, Quality

Seconds = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class ExchangeOptions(GaugeOptions):
    """Options of every described gauge on a line of bytes (StreamDevice's names and meanings)."""

    reply_timeout_s: Seconds | None = Field(default=None, description="to the first byte; the line's own if left out")
    gap_timeout_s: Seconds | None = Field(
        default=None, description="between two bytes of a reply; the line's own, for the whole reply, if left out"
    )
    extra_input: Literal["error", "ignore"] = Field(
        default="error",
        description="bytes behind a reply: a fault, or nothing to do with it (a gauge alone on its line)",
    )
    break_s: Seconds | None = Field(default=None, description="length of the break before every request, if it has one")
    line_needs: dict[Literal["dtr", "rts"], bool] = Field(
        default={}, description="DTR and RTS that power its cable: {dtr: true, rts: false} is HIGH and LOW"
    )


def ask(line: ByteLine, options: ExchangeOptions, request: bytes) -> float:
    """Send a request, after a break if there is one; return its time (s). Raises LineFault as the line does."""
    if options.break_s is not None:
        line.send_break(options.break_s)
    return line.send(request)


def receive(line: ByteLine, options: ExchangeOptions, count: int) -> bytes:
    """Exactly `count` bytes, the first of a reply. Raises LineFault as the line does."""
    if options.gap_timeout_s is None:
        return line.receive(count, options.reply_timeout_s)
    data = line.receive(1, options.reply_timeout_s)
    while len(data) < count:
        data += following(line, 1, options.gap_timeout_s, data)
    return data


def receive_line(
    line: ByteLine,
    terminator: bytes,
    limit: int,
    reply_timeout_s: float | None = None,
    gap_timeout_s: float | None = None,
) -> bytes:
    """Bytes up to `terminator`, without it: for replies of unknown length.

    Raises LineFault as the line does, MISMATCH beyond `limit` bytes.
    """
    data = line.receive(1, reply_timeout_s)
    while not data.endswith(terminator):
        if len(data) >= limit:
            raise LineFault(Quality.MISMATCH, f"no end within {limit} bytes: {data!r}")
        data += following(line, 1, gap_timeout_s, data)
    return data[: -len(terminator)]


def following(line: ByteLine, count: int, gap_timeout_s: float | None, so_far: bytes) -> bytes:
    """The next `count` bytes of a reply; INCOMPLETE if they do not come."""
    try:
        return line.receive(count, gap_timeout_s)
    except LineFault as fault:
        if fault.quality is Quality.TIMEOUT:
            raise LineFault(Quality.INCOMPLETE, f"only {so_far!r}") from fault
        raise


def nothing_behind(line: ByteLine, options: ExchangeOptions, reply: bytes) -> None:
    """Raises LineFault(MISMATCH) for bytes behind the reply, unless the options allow them."""
    if options.extra_input == "ignore":
        return
    try:
        extra = line.receive(1, 0.0)
    except LineFault as fault:
        if fault.quality is not Quality.TIMEOUT:
            raise
    else:
        raise LineFault(Quality.MISMATCH, f"bytes behind the reply: {reply!r} + {extra!r}")


class MenuSilence:
    """Distinguishes a device that is silent in its menu from a lost one.

    It had answered on this connection and then twice not: silent. The first time is a timeout like any other: the
    reply may only be late. A cable that came off looks the same as the menu.
    """

    def __init__(self) -> None:
        self._answered_on: ByteLine | None = None
        self._timeouts = 0

    def answered(self, line: ByteLine) -> None:
        """Note a whole reply."""
        self._answered_on = line
        self._timeouts = 0

    def named(self, fault: LineFault, line: ByteLine) -> LineFault:
        """The precise fault of a poll. Drains before SILENT. Raises LineFault as draining does."""
        if fault.quality is not Quality.TIMEOUT or self._answered_on is not line:
            return fault
        self._timeouts += 1
        if self._timeouts == 1:
            return fault
        line.drain()
        return LineFault(Quality.SILENT, f"{fault.detail}: in its menu, or its cable is off")
