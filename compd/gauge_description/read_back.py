"""Replies read by the new description: the values of each, and the first that does not fit."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import ValidationError

from compd.documents import separate_errors
from compd.errors import Problem
from compd.gauge import Gauge, LineFault, Quality
from compd.gauge_description.capture import CapturedReply
from compd.gauge_description.reply_columns import DescriptionError


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
