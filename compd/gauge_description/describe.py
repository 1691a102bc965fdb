"""From observed replies of an unknown gauge to a `serial_ascii` description, or to the questions that they leave open.

What never changed is taken for constant text, numbers with a decimal point (and whole numbers that changed) for
channels. The description is as narrow as the replies: a width that never changed must not change.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from compd.errors import Problem
from compd.gauge_description.ambiguities import number_questions, text_questions
from compd.gauge_description.answers import Answers
from compd.gauge_description.capture import CapturedReply
from compd.gauge_description.observed_channels import ObservedChannels
from compd.gauge_description.observed_exchange import ObservedExchange
from compd.gauge_description.read_back import read_back
from compd.gauge_description.reply_columns import DescriptionError, terminator_of
from compd.gauge_description.reply_form import escaped, reply_form
from compd.plugins import GAUGES, load


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
