"""From observed replies of an unknown gauge to a `serial_ascii` description, or to the questions that they leave open.

What never changed is taken for constant text, numbers with a decimal point (and whole numbers that changed) for
channels. The description is as narrow as the replies: a width that never changed must not change.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import ValidationError

from compd.documents import separate_errors
from compd.errors import Problem
from compd.gauge import Gauge, LineFault, Quality
from compd.gauge_description.ambiguities import number_questions, text_questions
from compd.gauge_description.answers import Answers
from compd.gauge_description.capture import CapturedReply
from compd.gauge_description.observed_channels import ObservedChannels
from compd.gauge_description.observed_exchange import ObservedExchange
from compd.gauge_description.reply_columns import DescriptionError, terminator_of
from compd.gauge_description.reply_form import escaped, reply_form
from compd.plugins import GAUGES, load


def read_back(options: Mapping[str, Any], driver: type[Gauge[Any]], captured: Sequence[CapturedReply]) -> list[str]:
    """The values of every captured reply by a description, as text; of several requests, of each round of them.

    options : of `driver` (serial_ascii), without `line`.
    Raises DescriptionError for options that the driver refuses, and for a reply that does not fit.
    """
    try:
        checked = driver.Options.model_validate({**options, "line": "learned"})
    except ValidationError as error:
        raise DescriptionError(
            [Problem("description", detail["msg"], value=str(detail["input"])) for detail in separate_errors(error)]
        ) from error
    texts = []
    for k, replies in enumerate(rounds(captured)):
        try:
            readings = driver(checked).read(_RepeatedReplies(replies))
        except LineFault as fault:
            raise DescriptionError.of(
                f"reply {k + 1}",
                f"does not fit the description: {fault}",
                value=", ".join(map(repr, replies.values())),
                allowed=str(options.get("in") or [request["in"] for request in options["requests"]]),
            ) from fault
        texts.append(", ".join(f"{r.value:.6g}" if r.ok else str(r.quality) for r in readings))
    return texts


def rounds(captured: Sequence[CapturedReply]) -> list[dict[bytes, bytes]]:
    """The replies to each request, one of each at a time; the last one repeats for a request with fewer."""
    by_request: dict[bytes, list[bytes]] = {}
    for request, reply in captured:
        by_request.setdefault(request, []).append(reply)
    count = max(map(len, by_request.values()))
    repeated = {
        request: itertools.islice(itertools.chain(replies, itertools.repeat(replies[-1])), count)
        for request, replies in by_request.items()
    }
    return [dict(zip(repeated, replies, strict=True)) for replies in zip(*repeated.values(), strict=True)]


class _RepeatedReplies:
    """A line with the same reply to a request every time."""

    def __init__(self, replies: Mapping[bytes, bytes]) -> None:
        self._replies = replies
        self._waiting = b""

    def send(self, request: bytes) -> float:
        self._waiting = self._replies[request]
        return 0.0

    def next_line(
        self, terminator: bytes, limit: int, timeout_s: float | None = None, gap_timeout_s: float | None = None
    ) -> tuple[bytes, float]:
        """A device that sends unsolicited readings repeats its line."""
        if not self._waiting:
            self._waiting = self._replies[b""]
        return self.receive_until(terminator, limit)[: -len(terminator)], 0.0

    def receive(self, count: int, timeout_s: float | None = None) -> bytes:
        if len(self._waiting) < count:
            raise LineFault(Quality.INCOMPLETE if self._waiting else Quality.TIMEOUT, repr(self._waiting))
        taken, self._waiting = self._waiting[:count], self._waiting[count:]
        return taken

    def receive_until(self, terminator: bytes, limit: int, timeout_s: float | None = None) -> bytes:
        end = self._waiting.find(terminator)
        if not 0 <= end <= limit - len(terminator):
            raise LineFault(Quality.MISMATCH, repr(self._waiting))
        return self.receive(end + len(terminator))

    def drain(self, quiet_s: float | None = None) -> bytes:
        return self.receive(len(self._waiting))


@dataclass(frozen=True)
class GaugeDescription:
    """Options for the driver `serial_ascii` (without `line`), and notes for looking up in the manual."""

    options: Mapping[str, Any]
    notes: tuple[str, ...]


def learn_gauge(captured: Sequence[CapturedReply], answers: Answers) -> tuple[GaugeDescription, list[str]]:
    """The description of a gauge, and its values of every reply.

    Raises DescriptionError if no description follows, with every question that is open, or where a reply does not
    fit the one that does.
    """
    description = describe_replies(captured, answers)
    return description, read_back(description.options, load(GAUGES, "serial_ascii", "driver serial_ascii"), captured)


def describe_replies(captured: Sequence[CapturedReply], answers: Answers) -> GaugeDescription:
    """The description of a gauge that gave `captured`. Raises DescriptionError as `learn_gauge` does."""
    terminator = terminator_of([reply for _, reply in captured])
    bodies: dict[bytes, list[bytes]] = {request: [] for request, _ in captured}
    for request, reply in captured:
        body = reply[: len(reply) - len(terminator)]
        if body not in answers.errors:
            bodies[request].append(body)
    exchanges = [ObservedExchange(request, replies, answers) for request, replies in bodies.items()]
    channels = ObservedChannels(exchanges, answers)
    problems = [*channels.problems]
    for exchange in exchanges:
        problems += [*exchange.problems, *_questions(exchange, channels, answers)]
    if problems:
        raise DescriptionError(list(dict.fromkeys(problems)))
    forms, notes = zip(*(reply_form(exchange, channels, answers) for exchange in exchanges), strict=True)
    options: dict[str, Any] = {"driver": "serial_ascii"}
    if len(exchanges) > 1:
        requests = [escaped(exchange.request) for exchange in exchanges]
        options["requests"] = [{"out": out, "in": form} for out, form in zip(requests, forms, strict=True)]
    else:
        options |= {"out": escaped(exchanges[0].request)} if exchanges[0].request else {}
        options["in"] = forms[0]
    options["in_terminator"] = escaped(terminator)
    if exchanges[0].mark != ".":
        options["decimal_mark"] = exchanges[0].mark
    options["channels"] = channels.options()
    if answers.errors:
        options["errors"] = [{"in": escaped(text, "%"), "quality": quality} for text, quality in answers.errors.items()]
    every = [note for some in notes for note in some]
    if without := [channel["name"] for channel in options["channels"] if "range" not in channel]:
        every.append(f"no range of {', '.join(without)}: write `range: [LOWEST, HIGHEST]` from the sensor's data sheet")
    return GaugeDescription(options, tuple(dict.fromkeys(every)))


def _questions(exchange: ObservedExchange, channels: ObservedChannels, answers: Answers) -> list[Problem]:
    """The questions on the contents of the columns."""
    questions: list[Problem] = []
    for k, column in enumerate(exchange.columns):
        if not column[0].is_number:
            questions += text_questions(exchange.columns, k, answers)
        elif channels.is_read(exchange, k) and not channels.is_in_question(exchange, k):
            unit = channels.unit(exchange, k)
            questions += number_questions(exchange.columns, k, unit, exchange.mark, answers)
    return questions
