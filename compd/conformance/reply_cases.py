"""Wrong replies: damaged, of other devices, with other units of length, errors."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args, get_origin

from pydantic import ValidationError

from compd.conformance import faults
from compd.conformance.case_result import (
    DAMAGED,
    GOOD,
    IN_VIRTUAL_TIME,
    NO_ANSWER,
    NO_NUMBER,
    Case,
    CaseResult,
    Subject,
    faulty_polls,
    one_poll_each,
    result_of,
    violations_of,
)
from compd.conformance.damage_cases import fault_at, good_poll
from compd.conformance.harness import ConformanceSession
from compd.conformance.peer import GOLDEN
from compd.conformance.reply_text import Forgery, ReplyText, most_frequent_length
from compd.conformance.value_cases import share_of
from compd.gauge import GaugeOptions, Quality


def other_settings(options: GaugeOptions) -> Iterator[tuple[str, GaugeOptions]]:
    """The change ("address=2") and the options, for whole numbers, texts ending in one, choices, switches."""
    for name, field in type(options).model_fields.items():
        if name in GaugeOptions.model_fields:
            continue
        for value in _others(getattr(options, name), field.annotation):
            try:
                other = type(options).model_validate({**options.model_dump(exclude_unset=True), name: value})
            except (ValidationError, ValueError):
                continue
            yield f"{name}={value}", other


def _others(value: Any, annotation: Any) -> list[Any]:
    """Other values of the same kind; [] if unknown."""
    if get_origin(annotation) is Literal:
        return [choice for choice in get_args(annotation) if choice != value]
    if isinstance(value, bool):
        return [not value]
    if isinstance(value, int):
        return [value + 1, value - 1]
    if isinstance(value, str) and (digits := re.search(r"\d+$", value)):
        return [value[: digits.start()] + f"{int(digits[0]) + 1:0{len(digits[0])}d}"[-len(digits[0]) :]]
    return []


# Modbus exceptions: all of a slave or gateway for a read, and one outside every table.
EXCEPTIONS = (1, 2, 3, 4, 5, 6, 7, 8, 10, 11, 0x5A)
SAMPLES = 48  # replies for learning the constant parts
FOREIGN = b"\x01\x84\x02\xc2\xc1\r\n"
BY_REGISTERS = "a line of registers checks its frames itself"


@dataclass(frozen=True)
class _Reply:
    """One of a poll's replies.

    number : the how manieth. values : of the sensors, with which its text was made. channels : that it has.
    others : by channel, the reply with other values of that channel.
    """

    number: int
    text: ReplyText
    values: Mapping[str, float]
    channels: Sequence[str]
    others: Mapping[str, Sequence[bytes]]


# Forgeries of a reply, and the channels that a driver must refuse in at least one of them.
ForgedSet = tuple[Sequence[Forgery], Iterable[str]]


def _forged(session: ConformanceSession, subject: Subject) -> CaseResult:
    case = "wrong unit, function, length"
    if not subject.registers:
        return faulty_polls(
            session, "another device's reply", DAMAGED | NO_ANSWER, one_poll_each(faults.replaced(FOREIGN))
        )
    kinds: list[faults.ForgedPart] = ["unit", "function", "length"]
    if subject.over_tcp:
        kinds.append("transaction")
    tries = one_poll_each(*(faults.forged(kind, subject.over_tcp) for kind in kinds))
    return faulty_polls(session, case, DAMAGED | (NO_ANSWER if subject.over_tcp else frozenset()), tries)


def _errors(session: ConformanceSession, subject: Subject) -> CaseResult:
    case = "error replies"
    if subject.registers:
        tries = one_poll_each(*(faults.refused(code, subject.over_tcp) for code in EXCEPTIONS))
        return faulty_polls(session, case, frozenset({Quality.DEVICE_ERROR}), tries)
    if not subject.error_replies:
        return CaseResult(case, "", "the simulated device names none in `error_replies`", "-")
    results = [
        faulty_polls(session, case, frozenset({quality}), one_poll_each(faults.replaced(reply)))
        for reply, quality in subject.error_replies.items()
    ]
    return next((result for result in results if result.verdict != "pass"), results[-1])


def _unlisted_errors(session: ConformanceSession, subject: Subject) -> CaseResult:
    """Texts without a number, and numbers without digits: errors that no list has."""

    def forgeries(reply: _Reply) -> Iterator[ForgedSet]:
        if not reply.text.is_text:
            return
        listed = [
            Forgery(f"{text!r} in its place", text)
            for error_reply in subject.error_replies
            for text in _other_digits(error_reply)
            if text not in subject.error_replies and len(text) != len(reply.text.base)  # one of its length is a value
        ]
        for forgery in [*reply.text.errors(), *listed]:
            yield [forgery], reply.channels
        for channel in reply.channels:
            for forgery in reply.text.fields(reply.others[channel]):
                yield [forgery], [channel]

    case, none = "errors that no list has", "its replies are no text"
    return _forged_replies(session, subject, case, forgeries, NO_NUMBER, "no number", none)


def _exchanged_characters(session: ConformanceSession, subject: Subject) -> CaseResult:
    """Letters, units of length and signs exchanged in replies that are text."""

    def forgeries(reply: _Reply) -> Iterator[ForgedSet]:
        if not reply.text.is_text:
            return
        for letters in reply.text.letters():
            yield letters, reply.channels  # a letter of a set may be a judgement
        for forgery in [*reply.text.units(), *reply.text.signs()]:
            yield [forgery], reply.channels

    case, none = "letters, units and signs exchanged", "its replies have none"
    return _forged_replies(session, subject, case, forgeries, NO_NUMBER, "no wrong number", none)


def _wrong_checksums(session: ConformanceSession, subject: Subject) -> CaseResult:
    """Whole replies with a single wrong byte in a known checksum."""

    def forgeries(reply: _Reply) -> Iterator[ForgedSet]:
        for forgery in reply.text.checksums():
            yield [forgery], reply.channels

    none = "its replies have none that is known here"
    return _forged_replies(session, subject, "a wrong checksum", forgeries, DAMAGED, "no number", none)


def _another_unit(session: ConformanceSession, subject: Subject) -> CaseResult:
    """A second device of the same kind, or one with other settings, answers in place of this one."""
    case = "another unit, or other settings"
    if why_not := _why_not(subject):
        return CaseResult(case, "", why_not, "-")
    violations: list[str] = []
    undetectable: list[str] = []
    tried = 0
    identity = (session.gauge.reply_identity or "").encode("latin-1")
    for reply in _replies(session):
        if reply.channels and (other := reply.text.without(identity)):
            violations.append(f"`reply_identity` is {identity!r}, and a reply is {other!r}")
        for forgery in [*reply.text.addresses(), *reply.text.identities(identity)]:
            violations += _taken(session, reply, forgery, reply.channels)
            tried += 1
    requests = [exchange.request for exchange in good_poll(session)]
    another = subject.another
    for setting, second in [(text, another(o)) for text, o in other_settings(subject.options)] if another else ():
        second.sensors.advance()  # values different from those of the first one
        replies = [exchange.reply for exchange in second.exchanges] if second.poll().ok else []
        others = [exchange.request for exchange in second.exchanges]
        who = "a device" if others == requests else "a unit"
        second.close()
        if not replies or any(others) != any(requests):  # a device without requests in bytes receives none
            continue
        tried += 1
        poll = session.poll([faults.replaced(reply) for reply in replies])
        text = f"the reply of {who} with {setting}, {b', '.join(replies)!r}"
        violations += [f"{text}: {wrong}" for wrong in poll.wrong]
        undetectable += [f"{text}: {wrong}" for wrong in poll.undetectable]
        session.recover()
    if not tried:
        return CaseResult(case, "", "the driver has no options that another unit would have otherwise", "-")
    return result_of(case, NO_NUMBER, f"{tried} of them, no wrong number", violations, undetectable)


def _forged_replies(
    session: ConformanceSession,
    subject: Subject,
    case: str,
    forgeries: Callable[[_Reply], Iterable[ForgedSet]],
    allowed: frozenset[Quality],
    passed: str,
    none: str,
) -> CaseResult:
    """Every set of forgeries in place of its reply; the driver must refuse at least one of a set.

    allowed : qualities, as of `result_of`. passed : what there was where all is well. none : why there is no forgery.
    """
    if why_not := _why_not(subject):
        return CaseResult(case, "", why_not, "-")
    violations: list[str] = []
    tried = 0
    for reply in _replies(session):
        for forged_set, channels in forgeries(reply):
            taken = [_taken(session, reply, forgery, channels) for forgery in forged_set]
            violations += taken[0] if all(taken) else []
            tried += len(taken)
    if not tried:
        return CaseResult(case, "", none, "-")
    return result_of(case, allowed, f"{tried} of them, {passed}", violations)


def _why_not(subject: Subject) -> str:
    """Reason why forged replies cannot be tried on this wire; "" if they can."""
    if subject.registers:
        return BY_REGISTERS
    return "" if subject.exact else IN_VIRTUAL_TIME


def _replies(session: ConformanceSession) -> Iterator[_Reply]:
    """Each reply of a poll without faults, with its constant parts."""
    received = good_poll(session)
    sampled = [_values_at(session, sample) for sample in range(SAMPLES)]
    for number, exchange in enumerate(received):
        replies = [session.replies.at([exchange], **values) for values in sampled]
        texts = [reply[0] if reply else b"" for reply in replies]
        length = most_frequent_length([text for text in texts if text])
        values, base = next((v, text) for v, text in zip(sampled, texts, strict=True) if len(text) == length)
        others = {
            channel: [
                reply[0]
                for sample in sampled
                if (reply := session.replies.at([exchange], **{**values, channel: sample[channel]}))
            ]
            for channel in values
        }
        channels = [channel for channel, varied in others.items() if set(varied) != {base}]
        yield _Reply(number, ReplyText(exchange.request, texts, base), values, channels, others)


def _values_at(session: ConformanceSession, sample: int) -> dict[str, float]:
    """Values all over the range of every channel."""
    return {
        name: share_of(session, name, ((sample + 1) * GOLDEN + index * 0.0719) % 1.0, logarithmic=sample % 2 == 1)
        for index, name in enumerate(session.sensors.values)
    }


def _taken(session: ConformanceSession, reply: _Reply, forgery: Forgery, channels: Iterable[str]) -> list[str]:
    """Violations by a driver that takes a number of `channels` from a forgery; [] if it refuses.

    A number that the device would itself have sent so is not wrong, nor one that is converted from another unit.
    """
    poll = session.poll(fault_at(reply.number, faults.replaced(forgery.reply)))
    violations = []
    if Quality.DRIVER_ERROR in poll.qualities:
        violations.append(f"{forgery.what}: {poll}: {forgery.reply!r}")
    for channel, reading in zip(session.gauge.channels, poll.readings, strict=False):
        if channel.name not in channels or not reading.ok or poll.undetectable:
            continue
        if forgery.factor is not None:
            converted = forgery.factor * reply.values[channel.name]
            digit = forgery.factor * session.replies.digit[channel.name]
            if abs(reading.value - converted) <= digit:
                continue
        violations.append(
            f"{forgery.what}: {channel.name} is {reading.value:.9g} {channel.unit}, ok, out of {forgery.reply!r}"
        )
    violations += [f"after {forgery.what}: {text}" for text in violations_of(session.recover()[1], GOOD)]
    return violations[:1]


def _other_digits(reply: bytes) -> Iterator[bytes]:
    """An error reply with other digits."""
    for digit in b"059":
        other = bytes(digit if 48 <= byte < 58 else byte for byte in reply)
        if other != reply:
            yield other


REPLY_CASES: tuple[Case, ...] = (
    _forged,
    _wrong_checksums,
    _another_unit,
    _exchanged_characters,
    _errors,
    _unlisted_errors,
)
