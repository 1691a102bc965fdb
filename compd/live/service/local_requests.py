"""What only clients of the Unix socket may ask: requests that change what the daemon computes with."""

from __future__ import annotations

from typing import Annotated, Self

import structlog
from pydantic import Field, field_validator, model_validator

from compd.live.service.client_session import ClientSession
from compd.live.service.message_keys.answers import AcceptKeys, ModelKeys, PollKeys, ZeroKeys
from compd.live.service.message_keys.message import present
from compd.live.service.messages import ErrorCode, ProtocolError
from compd.live.service.model_switch import ModelWish
from compd.live.service.order import OrderRequest
from compd.live.service.request import Asker
from compd.live.service.request_context import RequestContext, SendLater

_log = structlog.get_logger()


class AcceptRequest(OrderRequest):
    """Makes the daemon believe a gauge again that jumped, or came back with another value.

    A person asks it after looking at the gauge: what it reads from now on is taken as it is. The answer comes after a
    second, with what has become of it: a gauge that moves, or that other gauges contradict, is not believed. It does
    not come in turn: other answers may come before it.
    """

    wire_name = "ACCEPT"
    reply = AcceptKeys
    asker = Asker.LOCAL
    refusal = "gauges are accepted over the Unix socket only"
    gauge: Annotated[str, Field(min_length=1)] = present('a gauge, one channel as "gauge.channel", or "all"')

    @property
    def subject(self) -> str:
        return self.gauge

    def answer(self, context: RequestContext, client: ClientSession, send_later: SendLater) -> bytes:
        try:
            context.errands.accept(self.gauge, send_later)
        except ValueError as error:
            raise ProtocolError(ErrorCode.BAD_MESSAGE, str(error)) from error
        return b""


class PollRequest(OrderRequest):
    """Has a gauge polled at once that did not answer, and that is asked seldom since because the others waited for it.

    If it does not answer now either, it is asked as seldom as before.
    """

    wire_name = "POLL"
    reply = PollKeys
    asker = Asker.LOCAL
    refusal = "gauges are polled at once over the Unix socket only"
    gauge: Annotated[str, Field(min_length=1)] = present("a gauge that is polled, by its name")

    @property
    def subject(self) -> str:
        return self.gauge

    def answer(self, context: RequestContext, client: ClientSession, send_later: SendLater) -> bytes:
        try:
            context.errands.poll(self.gauge)
        except ValueError as error:
            raise ProtocolError(ErrorCode.BAD_MESSAGE, str(error)) from error
        _log.info("poll requested", gauge=self.gauge, client=client.name)
        return PollKeys.line()


class ZeroRequest(OrderRequest):
    """Takes machine zero, with the machine at rest at its zero position. The answer comes after about a second.

    It does not come in turn: other answers may come before it. Where a gauge differs by more than 0.5 mm from the
    machine zero until now, or is not believed, an error with the code `zero_differs` says so, and nothing has changed.
    """

    wire_name = "ZERO"
    reply = ZeroKeys
    asker = Asker.LOCAL
    refusal = "machine zero is taken over the Unix socket only"
    replace: bool = Field(default=False, description="true: take it whatever the machine zero before it was")

    @property
    def subject(self) -> str:
        return "replace" if self.replace else ""

    def answer(self, context: RequestContext, client: ClientSession, send_later: SendLater) -> bytes:
        context.errands.take_zero(self.replace, send_later)
        return b""


class ModelRequest(OrderRequest):
    """Asks which models the daemon runs with; with `file` or `hash` the daemon adopts that one first.

    The daemon opens no file that a client names: with a `file` the client sends an open descriptor of it (SCM_RIGHTS,
    unix(7)) in the same `sendmsg` as the line; the file is read from its start, is a regular file and has at most 1 MB.
    The answer comes when it has been read and tried, and the next cycle uses it; or an error with the code
    `model_refused` comes, and nothing has changed. An adopted model survives a crash of the loop and lasts until the
    daemon starts anew.
    """

    wire_name = "MODEL"
    reply = ModelKeys
    asker = Asker.LOCAL
    refusal = "models are asked for and adopted over the Unix socket only"
    file: str = Field(
        default="",
        description="absolute path of the model file whose descriptor comes with the line, by which people are told of "
        'it, "" for no model; left out, with `hash`: only tell the models',
    )
    shadow: bool = Field(default=False, description="true: compute this model's correction and do not apply it")
    hash: str = Field(
        default="",
        pattern="^[0-9a-f]{16}$",
        description="apply the model that runs as the shadow and has this hash; nothing is read again",
    )

    @field_validator("file")
    @classmethod
    def _absolute(cls, file: str) -> str:
        if file and not (file.startswith("/") and file.isprintable()):
            raise ValueError(f'file is {file[:200]!r}, allowed: an absolute path in printable characters, or ""')
        return file

    @model_validator(mode="after")
    def _named(self) -> Self:
        if self.hash and {"file", "shadow"} & self.model_fields_set:
            raise ValueError("hash stands alone: the model that has it is applied")
        if "shadow" in self.model_fields_set and "file" not in self.model_fields_set:
            raise ValueError("needs file, a text (shadow: true or false)")
        return self

    @property
    def is_order(self) -> bool:
        return bool(self.model_fields_set - {"by"})

    @property
    def subject(self) -> str:
        if self.hash:
            return f"apply the shadow {self.hash}"
        return f"{'run as the shadow' if self.shadow else 'apply'} {self.file or 'none'}"

    def answer(self, context: RequestContext, client: ClientSession, send_later: SendLater) -> bytes:
        if context.errands.switch_model is None:
            raise ProtocolError(ErrorCode.UNIX_ONLY, self.refusal)
        if self.is_order:
            context.errands.switch_model(
                ModelWish(self.file, self.shadow, self.hash), client.take_descriptor, send_later
            )
            return b""
        return ModelKeys.line(**context.messages.models())
