"""What a client may ask of the daemon: one class per request, with its keys, who may ask, and its answer.

To add a request, derive a class from `Request` in `client_requests` or `local_requests`, add a method to
`compd.client.Client`, and test both. The class gives the name on the wire, the keys as pydantic fields (checked
strictly, unknown keys refused), `answer`, and the keys of the answer's message.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pydantic import ValidationError

from compd.live.service import local_requests
from compd.live.service.client_requests import AuthRequest
from compd.live.service.client_session import ClientSession, Place
from compd.live.service.message_keys.answers import AuthKeys
from compd.live.service.message_keys.message import ErrorKeys, SentMessage
from compd.live.service.message_keys.readings import ReadingsKeys
from compd.live.service.message_keys.setpoint import SetpointKeys
from compd.live.service.messages import (
    QUOTED_CHARACTERS,
    ErrorCode,
    ProtocolError,
    bad_message,
    parse,
)
from compd.live.service.order import OrderBook, OrderKeys, OrderRequest
from compd.live.service.request import Asker, Request
from compd.live.service.request_context import RequestContext, SendLater


def _with_a_name(kind: type[Any]) -> Iterator[type[Request]]:
    """The requests among the classes below `kind`; others are bases of several."""
    for below in kind.__subclasses__():
        if "wire_name" in vars(below):
            yield below
        yield from _with_a_name(below)


# Those of any client first, whatever the order of the modules.
_KINDS = sorted(_with_a_name(Request), key=lambda kind: kind.__module__ == local_requests.__name__)
REQUESTS: Mapping[str, type[Request]] = {kind.wire_name: kind for kind in _KINDS}
# Only a line with one of these can have a place that is not its own; most lines need not be decoded to know.
_PLACED = tuple(f'"{name}"'.encode() for name, kind in REQUESTS.items() if kind.place is not Place.OWN)
_SENT: tuple[type[SentMessage], ...] = (
    *(kind.reply for kind in REQUESTS.values() if kind.reply is not None),
    AuthKeys,
    ErrorKeys,
    SetpointKeys,
    ReadingsKeys,
    OrderKeys,
)
SENT_MESSAGES: Mapping[str, type[SentMessage]] = {kind.wire_name: kind for kind in _SENT}


class Requests:
    """Reads requests and has them answered, on the publisher's thread."""

    def __init__(self, context: RequestContext) -> None:
        self.context = context
        self._orders = OrderBook(context.errands.tell_order, context.clock)

    def greeting(self, client: ClientSession) -> bytes:
        """The first line for a client: VERSION, or AUTH where it has to show a token."""
        client.authorized = client.local or self.context.access is None or not self.context.access.needs_token
        return self.context.version if client.authorized else AuthKeys.line()

    def admits(self, address: str) -> bool:
        """Whether a client at this IP address may connect over TCP at all."""
        return self.context.access is None or self.context.access.admits(address)

    def place_of(self, data: bytes) -> Place:
        """Of a line among those of its client that wait."""
        if not any(name in data for name in _PLACED):
            return Place.OWN
        try:
            kind = REQUESTS.get(parse(data).name)
        except ProtocolError:
            return Place.OWN
        return Place.OWN if kind is None else kind.place

    def answer(self, client: ClientSession, data: bytes, send_later: SendLater) -> bytes:
        """The answer to one line; b"" where there is none or it comes by `send_later`.

        Raises ProtocolError for a request that cannot be followed.
        """
        request = self._read(data)
        if not client.authorized and not isinstance(request, AuthRequest):
            raise ProtocolError(ErrorCode.NOT_AUTHORIZED, "the first line must be AUTH with the token")
        if request.asker is Asker.CONTROLLER and self.context.controller is not client and not client.local:
            raise ProtocolError(ErrorCode.NOT_CONTROLLER, request.refusal)
        if request.asker is Asker.LOCAL and not client.local:
            raise ProtocolError(ErrorCode.UNIX_ONLY, request.refusal)
        if isinstance(request, OrderRequest) and request.is_order:
            return self._follow(request, client, send_later)
        return request.answer(self.context, client, send_later)

    def _follow(self, order: OrderRequest, client: ClientSession, send_later: SendLater) -> bytes:
        """What `answer` does, for an order, which is noted with what becomes of it."""

        def send_and_note(reply: bytes) -> None:
            self._orders.note(order, client, reply)
            send_later(reply)

        try:
            reply = order.answer(self.context, client, send_and_note)
        except ProtocolError as error:
            self._orders.note(order, client, error.to_json())
            raise
        if reply:
            self._orders.note(order, client, reply)
        return reply

    def _read(self, data: bytes) -> Request:
        name, keys = parse(data)
        kind = REQUESTS.get(name)
        if kind is None:
            raise ProtocolError(
                ErrorCode.UNKNOWN_CLASS, f"class {name[:QUOTED_CHARACTERS]!r}, allowed: {', '.join(REQUESTS)}"
            )
        try:
            return kind.model_validate(keys)
        except ValidationError as error:
            raise bad_message(error, name, kind.allowed_keys(self.context)) from error
