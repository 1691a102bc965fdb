"""Options of a described ASCII gauge in the configuration, and their checks."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from typing import Literal, NamedTuple, Self, cast

from pydantic import Field, model_validator

from compd.lines import CHECKSUMS, ChecksumField, ChecksumKind
from compd.text import unescape
from compd_drivers.exchange import ExchangeOptions, Seconds
from compd_drivers.measured import DescriptionSection, MeasuredChannel, ReplyQuality, repeated
from compd_drivers.number_form import DecimalMark
from compd_drivers.reply_format import ReplyFormat

# Share of sampled values of all kinds beyond which an error form would leave no value; and their number.
NEARLY_EVERY = 0.9
SAMPLED_VALUES = 200
# Converters that people write by mistake in literal text. A request of an ADAM module begins with % and digits.
_REQUEST_PATTERN = re.compile(r"%%|%(?P<digits>[0#]?)(?P<skip>\d*)(?:\.(?P<behind>\d+))?<(?P<checksum>\w+)>|%\(\w+\)")
_WORD_PATTERN = re.compile(r"%%|%[*?(]|%[+ ]?[0-9.]*[fdexcs]\b")


class AsciiChannel(MeasuredChannel):
    """One number in the reply."""

    decimals: int = Field(default=0, ge=0, le=12, description="of a whole number (%d): 12345 with 4 is 1.2345")
    instead: dict[str, ReplyQuality] = Field(
        default={}, description='what may stand in the number\'s place, and what it means: {"ERR6": device_error}'
    )


class ErrorReply(DescriptionSection):
    """An error reply, which counts for the whole poll."""

    in_: str = Field(alias="in", description="what it looks like")
    quality: ReplyQuality = Field(description="what it means")
    says: str = Field(default="", description="in words, for the status")


class Exchange(DescriptionSection):
    """One request and its reply, without a value in it."""

    out: str = Field(min_length=1, description="what is sent, without its terminator")
    in_: str = Field(alias="in", description="what the reply looks like, without its terminator")


class ValueRequest(DescriptionSection):
    """One of several requests, and its reply with values in it."""

    out: str = Field(min_length=1, description="the request, without its terminator")
    in_: str = Field(alias="in", min_length=1, description="what the reply looks like, without its terminator")


class Echo(Exchange):
    """A request whose reply cannot be mistaken for a measurement."""

    every: int = Field(default=1, ge=1, description="interval in polls; 1 finds every reply that is behind")


class SerialAsciiOptions(ExchangeOptions):
    """Options of a described ASCII gauge."""

    out: str = Field(default="", description="the request; omitted for a device that sends unsolicited readings")
    dtr_pulse_s: Seconds | None = Field(
        default=None, description="in place of `out`: the request is DTR, LOW for this time, s"
    )
    out_terminator: str = Field(default="", description="what ends every request")
    in_: str = Field(alias="in", default="", description="what the reply looks like")
    requests: tuple[ValueRequest, ...] = Field(
        default=(), description="in place of `out` and `in`: requests that are made one after the other in every poll"
    )
    in_terminator: str = Field(description='what ends every reply; "": the reply has a fixed length')
    decimal_mark: DecimalMark = Field(default=".", description="of every number in the replies")
    channels: tuple[AsciiChannel, ...] = Field(min_length=1, description="the numbers in the reply, in their order")
    errors: tuple[ErrorReply, ...] = Field(
        default=(), description="looked at before the value; the first that fits counts"
    )
    init: tuple[Exchange, ...] = Field(default=(), description="sent before the first poll and after every fault")
    echo: Echo | None = Field(default=None, description="finds a reply that is one behind")
    silent_in_menu: bool = Field(default=False, description="the device does not answer while in its menu")

    @model_validator(mode="after")
    def _whole(self) -> Self:
        problems = [*self._request_problems(), *self._literal_problems()]
        if not problems:
            description = Description.of(self)
            problems += [*self._number_problems(description), *self._length_problems(description)]
        if problems:
            raise ValueError("; ".join(problems))
        return self

    def _literal_problems(self) -> Iterator[str]:
        """Apparent patterns in literal text."""
        exchanges: list[ValueRequest | Exchange] = [*self.requests, *self.init, *([self.echo] if self.echo else [])]
        for text in (self.out, *(exchange.out for exchange in exchanges)):
            if match := _REQUEST_PATTERN.search(text):
                yield f"{match[0]!r} in `out` {text!r}: a request is sent as it stands; write {_what_it_means(match)}"
        for channel in self.channels:
            for word in channel.instead:
                if match := _WORD_PATTERN.search(word):
                    yield (
                        f"{match[0]!r} in `instead` of channel {channel.name}: its words are literal, not patterns; "
                        "write each word that may come, or a form under `errors`"
                    )

    def _request_problems(self) -> Iterator[str]:
        if bool(self.in_) == bool(self.requests):
            yield "needs either `in` or `requests`"
        if self.requests and self.out:
            yield "with `requests` there is no `out`"
        if self.asked and self.dtr_pulse_s is not None:
            yield "the request is `out` or `dtr_pulse_s`, not both"
        if not self.asked and (self.init or self.echo or self.silent_in_menu):
            yield "a device that sends unsolicited readings, or by DTR, has no init, echo or silent_in_menu"
        if not self.asked and self.dtr_pulse_s is None and not self.in_terminator:
            yield "a device that sends unsolicited readings needs an `in_terminator`"

    def _number_problems(self, description: Description) -> Iterator[str]:
        names = [channel.name for channel in self.channels]
        if doubled := repeated(names):
            yield f"channel named twice: {doubled}"
        numbers = [number for poll in description.polls for number in poll.reply.channels]
        if numbers != [""] or len(names) > 1:
            if missing := [name for name in names if name not in numbers]:
                yield f"`in` has no %({missing[0]})f"
            if unknown := [number for number in numbers if number not in names]:
                yield f"`in` has a number {unknown[0] or 'without name'}, channels are {', '.join(names)}"
            if doubled := repeated(numbers):
                yield f"channel {doubled or 'without name'} is in several replies"
        if shadowed := description.error_like_a_value():
            yield "error {!r} fits nearly every value of the form {!r}".format(*shadowed)

    def _length_problems(self, description: Description) -> Iterator[str]:
        if not self.in_terminator and None in description.lengths:
            yield "without `in_terminator` every reply must have a fixed length: give every width"
        elif not self.in_terminator and len(set(description.lengths)) > 1:
            yield "without `in_terminator` all replies, errors too, must have the same length"

    @property
    def asked(self) -> bool:
        """Whether the device is polled by bytes."""
        return bool(self.out or self.requests)

    @property
    def values(self) -> tuple[tuple[str, str], ...]:
        """Each request with values in its reply, without terminator, and the reply's form."""
        return tuple((request.out, request.in_) for request in self.requests) or ((self.out, self.in_),)


class PollForm(NamedTuple):
    """One request as bytes (b"" for none), and its reply."""

    request: bytes
    reply: ReplyFormat
    text: str


class Description(NamedTuple):
    """The compiled texts of the options."""

    polls: tuple[PollForm, ...]
    errors: tuple[tuple[ReplyFormat, ErrorReply], ...]
    terminator: bytes

    @classmethod
    def of(cls, options: SerialAsciiOptions) -> Self:
        """ValueError for a faulty text."""
        single = len(options.channels) == 1
        instead = {c.name: {unescape(word) for word in c.instead} for c in options.channels}
        if single:
            instead[""] = instead[options.channels[0].name]
        mark = options.decimal_mark
        for exchange in (*options.init, *([options.echo] if options.echo else [])):
            _format(exchange.in_, mark)
        return cls(
            tuple(
                PollForm(unescape(out) + unescape(options.out_terminator), _format(form, mark, instead), form)
                for out, form in options.values
            ),
            tuple((_format(error.in_, mark), error) for error in options.errors),
            unescape(options.in_terminator),
        )

    def error_like_a_value(self) -> tuple[str, str] | None:
        """The first error form that matches nearly every value of a reply, and that reply's form."""
        for poll in self.polls if self.errors else ():
            values = list(poll.reply.samples(SAMPLED_VALUES))
            for form, error in self.errors:
                if sum(form.match(value) is not None for value in values) > NEARLY_EVERY * len(values):
                    return error.in_, poll.text
        return None

    @property
    def lengths(self) -> tuple[int | None, ...]:
        """Length of every possible reply of the device."""
        return tuple(form.length for form in (*(poll.reply for poll in self.polls), *(form for form, _ in self.errors)))


def _what_it_means(match: re.Match[str]) -> str:
    """The literal text of a request in place of a converter."""
    if match[0] == "%%":
        return "a single %"
    if match["checksum"] not in CHECKSUMS:
        return "the characters themselves"
    kind, digits = cast(ChecksumKind, match["checksum"]), cast(Literal["", "0", "#"], match["digits"])
    field = ChecksumField("", kind, int(match["skip"] or 0), int(match["behind"] or 0), digits)
    try:
        checksum = field.of(unescape(match.string[: match.start()]))
    except ValueError:
        return "its digits"
    return repr(checksum.decode() if digits else "".join(f"\\x{byte:02x}" for byte in checksum)).replace("\\\\", "\\")


def _format(text: str, mark: DecimalMark, instead: Mapping[str, Collection[bytes]] | None = None) -> ReplyFormat:
    """ValueError names the faulty text."""
    try:
        return ReplyFormat(text, instead, mark)
    except ValueError as error:
        raise ValueError(f"in {text!r}: {error}") from error
