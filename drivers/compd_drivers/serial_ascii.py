r"""Generic ASCII gauge: a description in the configuration, in the manner of StreamDevice's protocol files.

`out` is what is sent, `in` what the reply must look like (converters: `compd_drivers.reply_format`). Three examples
from manuals' pages (M, read in manuals):

Magnescale MG80-SC1, page 39: module, counter, mode N, unit M, judgement, 8 characters; "Error" for an alarm
    magnescale:
      driver: serial_ascii
      line: comparators
      out: "R"
      out_terminator: "\r\n"
      in: "00NM%*[UGLE]%(a)+08.4f 01NM%*[UGLE]%(b)+08.4f"
      in_terminator: "\r\n"
      channels:
        - {name: a, unit: mm, range: [-99, 99], instead: {"   Error": sensor_fault}}
        - {name: b, unit: mm, range: [-99, 99], instead: {"   Error": sensor_fault}}

Sylvac OPTO-RS, page 12: sign, digits, point, digits, CR; ERR0 sensor, ERR1 command, ERR2 parity, ERR3 range
    sylvac:
      driver: serial_ascii
      line: dial
      out: "?"
      out_terminator: "\r"
      in: "% .3f"
      in_terminator: "\r"
      channels: [{name: position, unit: mm, range: [-12.5, 12.5]}]
      errors:
        - {in: "ERR0", quality: sensor_fault}
        - {in: "ERR3", quality: over_range}
        - {in: "ERR%*1[12]", quality: device_error}

Wagner Force Ten, page 25: blank or minus, 5 digits and point, blank, unit, Peak in a peak mode; HELP: overloaded
    force:
      driver: serial_ascii
      line: force
      in: "% 7.2f LB "
      in_terminator: "\r\n"
      channels: [{name: force, unit: N, scale: 4.4482216152605, range: [-450, 450]}]
      errors: [{in: "%*?[ ]HELP%*?[ LB]", quality: over_range}]

A device that is asked by a pulse of DTR has `dtr_pulse_s` in place of `out`; `line_needs` powers its cable.
A device that sends unsolicited readings, as the last, has no `out`: each of its lines counts, never a half one, and its
time is that at which the line before it began; `reply_timeout_s` must be longer than its period. A device with a
request for each of its values (M1, M2 ...) has `requests: [{out: M1, in: ...}, ...]` in place of `out` and `in`; each
channel has the time of its own request. `echo` is a second request whose reply looks different: asked before every
`every`-th poll, it finds a device whose replies are one behind. Devices that fall silent by design (in their menu) get
`silent_in_menu: true`: after a whole reply on a connection, the second poll without any byte is `silent` instead of
`timeout`. A cable that comes off afterwards looks the same, and the detail says so; both are without a value.

Without a checksum in `in` a damaged digit is still a digit: a length that is not where the last ones lead is asked for
a second time, as those of all gauges are. Other quantities are not: set a parity on the line.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, ClassVar, Literal

from compd.gauge import ByteLine, Channel, Gauge, GaugeOptions, LineFault, OptionDoubt, Quality, Reading, bad
from compd.text import unescape
from compd_drivers.ascii_description import Description, ErrorReply, PollForm, SerialAsciiOptions
from compd_drivers.exchange import MenuSilence, ask, nothing_behind, receive, receive_line
from compd_drivers.measured import RANGE_OPTION, doubts
from compd_drivers.reply_format import MultipliedNumber, ReplyFormat


class SerialAscii(Gauge[ByteLine]):
    """One described device."""

    Options: ClassVar[type[GaugeOptions]] = SerialAsciiOptions
    line_kind = "bytes"
    range_option: ClassVar[str] = RANGE_OPTION
    sample_options: ClassVar[Mapping[str, Any] | None] = {
        "out": "M",
        "out_terminator": r"\r\n",
        "in": "M,%(a)+09.4f,%(b)+8.3f",
        "in_terminator": r"\r\n",
        "channels": [
            {"name": "a", "unit": "mm", "instead": {"---------": "sensor_fault"}},
            {"name": "b", "unit": "um", "instead": {"FAULT": "sensor_fault"}, "scale": 10},
        ],
        "errors": [{"in": "ER%*2[0-9]", "quality": "device_error"}],
    }

    def __init__(self, options: SerialAsciiOptions) -> None:
        super().__init__(options)
        self._description = Description.of(options)
        self._measured = options.channels
        self._protocol = options
        self._channels = tuple(channel.channel for channel in options.channels)
        self._places = [self._place(channel.name) for channel in options.channels]
        self._full_scale = [self._description.polls[poll].reply.full_scale(number) for poll, number in self._places]
        self._instead = [{unescape(word): quality for word, quality in c.instead.items()} for c in options.channels]
        terminator = unescape(options.out_terminator)
        exchanges = [*options.init, *([options.echo] if options.echo else [])]
        self._exchanges = [
            (unescape(exchange.out) + terminator, ReplyFormat(exchange.in_, mark=options.decimal_mark))
            for exchange in exchanges
        ]
        forms = [*(poll.reply for poll in self._description.polls), *(form for _, form in self._exchanges)]
        self._fixed_length = all(form.length is not None for form in forms)
        forms += [form for form, _ in self._description.errors]
        self._limit = max(form.longest for form in forms) + len(self._description.terminator)
        self._ready_on: ByteLine | None = None  # the connection on which `init` was sent
        self._until_echo = 0
        self._silence = MenuSilence()

    @property
    def channels(self) -> Sequence[Channel]:
        return self._channels

    def doubts(self) -> Iterable[OptionDoubt]:
        return doubts(self._measured, self.range_option)

    @property
    def reply_identity(self) -> str | None:
        beginnings = [poll.reply.beginning for poll in self._description.polls]
        common = itertools.takewhile(lambda bytes_there: len(set(bytes_there)) == 1, zip(*beginnings, strict=False))
        return bytes(first for first, *_ in common).decode("latin-1") or None

    @property
    def line_needs(self) -> Mapping[Literal["dtr", "rts"], bool]:
        return self._protocol.line_needs

    @property
    def serial_signals(self) -> Sequence[Literal["DTR", "break"]]:
        signals: dict[Literal["DTR", "break"], float | None] = {
            "DTR": self._protocol.dtr_pulse_s,
            "break": self._protocol.break_s,
        }
        return [signal for signal, duration_s in signals.items() if duration_s is not None]

    def traffic(self) -> Sequence[tuple[int, int]] | None:
        exchanges = []
        for poll in self._description.polls:
            if poll.reply.length is None or not self._protocol.asked:
                return None
            exchanges.append((len(poll.request), poll.reply.length + len(self._description.terminator)))
        return exchanges

    def read(self, line: ByteLine) -> Sequence[Reading]:
        """Raises LineFault: as the line does, MISMATCH for a reply of another form, CRC for a wrong checksum,
        DEVICE_ERROR and others for the described error replies, SILENT."""
        try:
            readings = self._readings(line)
        except LineFault as fault:
            self._ready_on = None
            raise (self._silence.named(fault, line) if self._protocol.silent_in_menu else fault) from None
        self._silence.answered(line)
        return readings

    def _readings(self, line: ByteLine) -> Sequence[Reading]:
        if self._ready_on is not line:
            for request, form in self._exchanges[: len(self._protocol.init)]:
                self._exchange(line, request, form)
            self._until_echo = 0
        self._check_echo(line)
        replies = [self._values(line, poll) for poll in self._description.polls]
        # a device that reports trouble is initialised again
        in_trouble = any(
            isinstance(answer, Reading) and answer.quality is Quality.DEVICE_ERROR for answer, _ in replies
        )
        self._ready_on = None if in_trouble else line
        readings = []
        for k, (poll, number) in enumerate(self._places):
            answer, time_s = replies[poll]
            readings.append(answer if isinstance(answer, Reading) else self._reading(k, answer[number], time_s))
        return readings

    def _place(self, channel: str) -> tuple[int, int]:
        """The request and the index of the channel's number in its reply; the only number if unnamed."""
        for k, poll in enumerate(self._description.polls):
            if channel in poll.reply.channels:
                return k, poll.reply.channels.index(channel)
        return 0, 0

    def _values(self, line: ByteLine, poll: PollForm) -> tuple[tuple[float | bytes, ...] | Reading, float]:
        """The numbers in a request's reply, or the error that it is, and the time of asking (s)."""
        reply, time_s = self._poll(line, poll)
        error = self._error(reply)  # before the value: an error may look like one
        if error is not None:
            return bad(time_s, Quality(error.quality), _shown(reply, error)), time_s
        values = poll.reply.match(reply)
        if values is None:
            raise self._misfit(reply, poll.reply)
        return values, time_s

    def _poll(self, line: ByteLine, poll: PollForm) -> tuple[bytes, float]:
        """The reply without its terminator, and the time of asking (s)."""
        if self._protocol.dtr_pulse_s is not None:
            time_s = line.pulse_dtr(self._protocol.dtr_pulse_s)
        elif not self._protocol.asked:
            return self._unsolicited(line, poll.reply)
        else:
            time_s = ask(line, self._protocol, poll.request)
        return self._whole(line, poll.reply), time_s

    def _unsolicited(self, line: ByteLine, form: ReplyFormat) -> tuple[bytes, float]:
        """The next reply of a device that sends unsolicited readings, and its time (s)."""
        terminator, protocol = self._description.terminator, self._protocol
        waits_s = protocol.reply_timeout_s, protocol.gap_timeout_s
        try:
            reply, time_s = line.next_line(terminator, self._limit, *waits_s)
            for _ in range(form.literal.count(terminator)):
                if self._error(reply) is not None:
                    break
                reply += terminator + line.next_line(terminator, self._limit, *waits_s)[0]
        except LineFault as fault:
            if fault.quality is not Quality.TIMEOUT:
                raise
            text = f"{fault.detail}; `reply_timeout_s` must be longer than the period of unsolicited readings"
            raise LineFault(fault.quality, text) from fault
        return reply, time_s

    def _exchange(self, line: ByteLine, request: bytes, form: ReplyFormat) -> None:
        """One exchange without a value; an error reply to it is a fault of the whole poll."""
        ask(line, self._protocol, request)
        reply = self._whole(line, form)
        if error := self._error(reply):
            raise LineFault(Quality(error.quality), _shown(reply, error))
        if form.match(reply) is None:
            raise self._misfit(reply, form)

    def _check_echo(self, line: ByteLine) -> None:
        if self._protocol.echo is None:
            return
        if self._until_echo == 0:
            self._exchange(line, *self._exchanges[-1])
            self._until_echo = self._protocol.echo.every
        self._until_echo -= 1

    def _whole(self, line: ByteLine, form: ReplyFormat) -> bytes:
        """A reply without its last terminator, and nothing behind it."""
        reply = self._receive(line, form)
        nothing_behind(line, self._protocol, reply)
        return reply

    def _receive(self, line: ByteLine, form: ReplyFormat) -> bytes:
        terminator = self._description.terminator
        if not terminator:
            return receive(line, self._protocol, self._limit)
        reply = self._line(line)
        for _ in range(form.literal.count(terminator)):
            if self._error(reply) is not None:
                break
            reply += terminator + self._line(line)
        return reply

    def _line(self, line: ByteLine) -> bytes:
        """Up to the next terminator, without it."""
        terminator, protocol = self._description.terminator, self._protocol
        if self._fixed_length and protocol.gap_timeout_s is None:
            return line.receive_until(terminator, self._limit, protocol.reply_timeout_s)[: -len(terminator)]
        return receive_line(line, terminator, self._limit, protocol.reply_timeout_s, protocol.gap_timeout_s)

    def _error(self, reply: bytes) -> ErrorReply | None:
        return next((error for form, error in self._description.errors if form.match(reply) is not None), None)

    def _misfit(self, reply: bytes, form: ReplyFormat) -> LineFault:
        """The fault for a reply that is neither of this form nor a described error."""
        if form.checksum_fails(reply):
            return LineFault(Quality.CRC, repr(reply))
        return LineFault(Quality.MISMATCH, f"{reply!r} is not what was expected")

    def _reading(self, k: int, value: float | bytes, time_s: float) -> Reading:
        channel = self._measured[k]
        if isinstance(value, bytes):
            return bad(time_s, Quality(self._instead[k][value]), value.decode("ascii", "backslashreplace").strip())
        raw = value.raw if isinstance(value, MultipliedNumber) else value
        return channel.reading(value / 10**channel.decimals, time_s, raw, self._full_scale[k])


def _shown(reply: bytes, error: ErrorReply) -> str:
    text = reply.decode("ascii", "backslashreplace")
    return f"{text}: {error.says}" if error.says else text
