"""Orders: requests that change what the machine does, and the record of who gave them."""

from __future__ import annotations

import json
from abc import abstractmethod
from collections.abc import Callable
from typing import Annotated

import structlog
from pydantic import AfterValidator, Field

from compd.clock import Clock
from compd.live.service.client_session import ClientSession
from compd.live.service.message_keys.message import SentMessage, absent, present
from compd.live.service.request import Request

MAX_BY = 200
# Characters: a path.
MAX_SUBJECT = 1000

_log = structlog.get_logger()


def _shown(subject: str) -> str:
    """A subject as the log and recordings have it: a client may have written anything."""
    return "".join(letter if letter.isprintable() else "?" for letter in subject[:MAX_SUBJECT])


def _one_line(by: str) -> str:
    """The text itself; ValueError where it could end a line of the log, or change a terminal."""
    if not by.isprintable():
        raise ValueError("by must be one line of printable characters")
    return by


class OrderRequest(Request):
    """Base of the requests that the log and recordings keep, with who gave them and what became of them."""

    by: Annotated[str, AfterValidator(_one_line)] = Field(
        default="",
        max_length=MAX_BY,
        description=f"for whom the client asks, as it says; one line of at most {MAX_BY} characters, for the log "
        "and recordings",
    )

    @property
    def is_order(self) -> bool:
        """Whether it changes anything."""
        return True

    @property
    @abstractmethod
    def subject(self) -> str:
        """What the order is about: a gauge, a model file."""


class OrderKeys(SentMessage):
    """An order that a client gave, once it is done or refused. Sent to whoever watches `READINGS`, in between."""

    wire_name = "ORDER"
    time_s: float = present("when, s of the daemon's monotonic clock")
    order: str = present("class of the request: ZERO, ACCEPT, POLL, MODEL or RELEASE")
    subject: str | None = absent("the gauge, the model file, the controller")
    client: str = present('who gave it: "unix, user 1000", or address and port over TCP')
    by: str | None = absent("for whom, as the client says")
    done: bool = present("false: it was refused, and nothing has changed")


class OrderBook:
    """Writes every order to the log, and tells it to whoever records."""

    def __init__(self, tell: Callable[[bytes], None], clock: Clock) -> None:
        """`tell` gets an ORDER line, from any thread."""
        self._tell = tell
        self._clock = clock

    def note(self, request: OrderRequest, client: ClientSession, reply: bytes) -> None:
        """`reply`: the answer's line, by which the order is done, or an ERROR; called from any thread."""
        answer = json.loads(reply)
        done = answer["class"] != "ERROR"
        order, subject, by = request.wire_name, _shown(request.subject), request.by
        if done:
            _log.info("order done", order=order, subject=subject, client=client.name, by=by)
        else:
            reason = answer["text"]
            _log.warning("order refused", order=order, subject=subject, client=client.name, by=by, reason=reason)
        at_s = self._clock.monotonic()
        self._tell(
            OrderKeys.line(
                time_s=at_s, order=order, subject=subject or None, client=client.name, by=by or None, done=done
            )
        )
