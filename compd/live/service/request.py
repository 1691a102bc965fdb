"""What every request of a client has: its name on the wire, its keys, who may ask, and its answer."""

from __future__ import annotations

from abc import abstractmethod
from enum import Enum
from typing import ClassVar

from pydantic import BaseModel, ConfigDict

from compd.live.service.client_session import ClientSession, Place
from compd.live.service.message_keys.message import SentMessage
from compd.live.service.request_context import RequestContext, SendLater


class Asker(Enum):
    """Which clients may send a request."""

    ANYBODY = "any client"
    CONTROLLER = "the controller, and clients of the Unix socket"
    LOCAL = "clients of the Unix socket"


class Request(BaseModel):
    """Base of all requests; the fields of a subclass are the keys of its message.

    wire_name : the message's "class".  reply : the keys of its answer; None where there is none.
    asker : who may ask.  refusal : the text of the error that anybody else gets.
    place : what one that comes does with those of the same client that still wait.
    """

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)
    wire_name: ClassVar[str]
    reply: ClassVar[type[SentMessage] | None] = None
    asker: ClassVar[Asker] = Asker.ANYBODY
    refusal: ClassVar[str] = ""
    place: ClassVar[Place] = Place.OWN

    @classmethod
    def allowed_keys(cls, context: RequestContext) -> tuple[str, ...]:
        """The keys that this machine accepts, for the error about an unknown one."""
        return tuple(cls.model_fields)

    @abstractmethod
    def answer(self, context: RequestContext, client: ClientSession, send_later: SendLater) -> bytes:
        """Do it, on the publisher's thread, and return the answer's line; b"" where there is none or it comes later.

        Raises ProtocolError where it cannot be done.
        """
