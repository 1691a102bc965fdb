"""What a client may ask of the daemon: one class per request, with its keys, who may ask, and its answer.

To add a request, derive a class from `Request` here, add a method to `compd.client.Client`, and test both. The class
gives the name on the wire, the keys as pydantic fields (checked strictly, unknown keys refused), `answer`, and the keys
of the answer's message.
"""

from __future__ import annotations

import math
import re
from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from compd.live.loop.commands import Commands, Target
from compd.live.service.client_session import ClientSession, Stream
from compd.live.service.message_keys import (
    ErrorKeys,
    Keys,
    ModelsKeys,
    ReadingsKeys,
    SentMessage,
    SetpointKeys,
    StatusKeys,
    VersionKeys,
)
from compd.live.service.messages import (
    LARGEST_NUMBER,
    QUOTED_CHARACTERS,
    ErrorCode,
    ProtocolError,
    bad_message,
    line,
    parse,
    unknown_key,
)
from compd.live.service.readings_message import ReadingsMessage

Coordinate = Annotated[float, Field(ge=-LARGEST_NUMBER, le=LARGEST_NUMBER)]
Vector = Annotated[list[Coordinate], Field(min_length=3, max_length=3)]

# In no file's name: the null character, and halves of surrogate pairs.
_NOT_IN_PATHS = re.compile("[\0\ud800-\udfff]")

# Sends a line to the client that asked, from any thread: the answer to a request that takes time.
SendLater = Callable[[bytes], None]


class Asker(Enum):
    """Which clients may send a request."""

    ANYBODY = "any client"
    CONTROLLER = "the controller alone"
    LOCAL = "clients of the Unix socket"


@dataclass(frozen=True)
class TargetKeys:
    """Which keys TARGET has on this machine.

    tip : "tip_B0_mm", or "tip_P_mm" with the tool on the plate.
    rotation : whether "rotation_B0_rad" is allowed: a hexapod's attitude is free, a tripod's follows from its tip.
    """

    tip: Literal["tip_B0_mm", "tip_P_mm"]
    rotation: bool

    @property
    def names(self) -> tuple[str, ...]:
        return (self.tip, "rotation_B0_rad") if self.rotation else (self.tip,)


class Request(BaseModel):
    """Base of all requests; the fields of a subclass are the keys of its message.

    wire_name : the message's "class".  reply : the keys of its answer; None where there is none.
    asker : who may ask.  refusal : the text of the error that anybody else gets.
    """

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)
    wire_name: ClassVar[str]
    reply: ClassVar[type[SentMessage] | None] = None
    asker: ClassVar[Asker] = Asker.ANYBODY
    refusal: ClassVar[str] = ""

    @classmethod
    def allowed_keys(cls, requests: Requests) -> tuple[str, ...]:
        """The keys that this machine accepts, for the error about an unknown one."""
        return tuple(cls.model_fields)

    @abstractmethod
    def answer(self, requests: Requests, client: ClientSession, send_later: SendLater) -> bytes:
        """Do it, on the publisher's thread, and return the answer's line; b"" where there is none or it comes later.

        Raises ProtocolError where it cannot be done.
        """


class ColumnKeys(Keys):
    """One column of a recording: sign * (value - machine zero) for a length, the value itself for anything else."""

    column: str = Field(description="the column's name, which ends in its unit")
    channel: str = Field(description='the gauge\'s channel, "gauge.channel", as in READINGS')
    sign: Literal[1, -1] | None = Field(default=None, description="lengths: -1 where the display falls as it grows")
    stale_after_s: float = Field(description="a reading older than this is stale, s")


class WatchKeys(SentMessage):
    """Answers WATCH, with the keys of the request."""

    wire_name = "WATCH"
    what: Literal["setpoints", "readings"] | None = Field(default=None, description="as in the request")
    rate_hz: float | None = Field(default=None, description="as in the request, Hz")
    columns: list[ColumnKeys] | None = Field(default=None, description="of readings: which channel is which column")


class WatchRequest(Request):
    """Asks for setpoints, or for the readings behind them, from now on.

    The answer has the same keys. Then the messages come until the connection ends or another `WATCH` asks for others.
    """

    wire_name = "WATCH"
    reply = WatchKeys
    what: Literal["setpoints", "readings"] = Field(
        default="setpoints",
        description="setpoints: `SETPOINT` messages; readings: `READINGS` messages, over the Unix socket only",
    )
    rate_hz: Annotated[int | float, Field(ge=0, le=LARGEST_NUMBER)] = Field(
        default=math.inf, description="messages per second (Hz); left out: one for every cycle; 0: none"
    )

    def answer(self, requests: Requests, client: ClientSession, send_later: SendLater) -> bytes:
        message = {"class": self.wire_name, **self.model_dump(exclude_unset=True)}
        if self.what == "setpoints":
            client.watch(self.rate_hz, Stream.SETPOINTS)
            return line(message)
        if not client.local or requests.readings is None:
            # READINGS are several times a SETPOINT's size, and their times are those of this computer's clock.
            raise ProtocolError(ErrorCode.UNIX_ONLY, "readings are watched over the Unix socket only")
        client.watch(self.rate_hz, Stream.READINGS)
        return line(message | {"columns": requests.readings.columns})


class TargetRequest(Request):
    """Asks for setpoints that bring the tip to this target. There is no answer; the next setpoint is for it.

    The first client that sends a valid one is the controller, until it sends `RELEASE` or its connection ends. Which of
    the two tips it gives depends on where the machine has its tool.
    """

    wire_name = "TARGET"
    tip_B0_mm: Vector | None = Field(default=None, description="the tip in {B0}, mm: [x, y, z]; tool on the platform")
    tip_P_mm: Vector | None = Field(
        default=None, description="the touched place in {P}, mm: [x, y, z]; tool on the surface plate"
    )
    rotation_B0_rad: Vector | None = Field(
        default=None,
        description="hexapod: rotation vector of {P} in {B0}, rad; left out: the attitude at machine zero",
    )

    @classmethod
    def allowed_keys(cls, requests: Requests) -> tuple[str, ...]:
        return requests.target_keys.names

    def answer(self, requests: Requests, client: ClientSession, send_later: SendLater) -> bytes:
        keys = requests.target_keys
        if foreign := sorted(self.model_fields_set.difference(keys.names)):
            raise unknown_key(self.wire_name, foreign[0], keys.names)
        tip_mm = getattr(self, keys.tip)
        if tip_mm is None:
            raise ProtocolError(ErrorCode.BAD_MESSAGE, f"needs {keys.tip}, three numbers")
        if requests.controller not in {None, client}:
            raise ProtocolError(ErrorCode.ROLE_TAKEN, "another client is the controller")
        rotation = self.rotation_B0_rad
        requests.controller = client
        requests.commands.target = Target(tuple(tip_mm), None if rotation is None else tuple(rotation))
        return b""


class ReleaseKeys(SentMessage):
    """Answers RELEASE: the mode is CMM again."""

    wire_name = "RELEASE"


class ReleaseRequest(Request):
    """Gives the controller's role back: the mode is CMM again."""

    wire_name = "RELEASE"
    reply = ReleaseKeys
    asker = Asker.CONTROLLER
    refusal = "only the controller can release its role"

    def answer(self, requests: Requests, client: ClientSession, send_later: SendLater) -> bytes:
        requests.release(client)
        return line({"class": self.wire_name})


class StatusRequest(Request):
    """Asks how the daemon, its lines and its gauges are doing."""

    wire_name = "STATUS"
    reply = StatusKeys

    def answer(self, requests: Requests, client: ClientSession, send_later: SendLater) -> bytes:
        return line(requests.status())


class VersionRequest(Request):
    """Asks which daemon, machine and configuration this is. The answer also greets every new client."""

    wire_name = "VERSION"
    reply = VersionKeys

    def answer(self, requests: Requests, client: ClientSession, send_later: SendLater) -> bytes:
        return requests.version


class ZeroKeys(SentMessage):
    """Answers ZERO when machine zero has been taken."""

    wire_name = "ZERO"
    taken_at: str = Field(description="when, UTC, ISO 8601")
    path: str = Field(description="the file in which it is kept")
    readings_mm: dict[str, float] = Field(description="mean raw reading of every length gauge, by channel, mm")


class ZeroRequest(Request):
    """Takes machine zero, with the machine at rest at its zero position. The answer comes after about a second.

    It does not come in turn: other answers may come before it.
    """

    wire_name = "ZERO"
    reply = ZeroKeys
    asker = Asker.LOCAL
    refusal = "machine zero is taken over the Unix socket only"

    def answer(self, requests: Requests, client: ClientSession, send_later: SendLater) -> bytes:
        requests.take_zero(send_later)
        return b""


class ModelKeys(SentMessage, ModelsKeys):
    """Answers MODEL."""

    wire_name = "MODEL"


class ModelRequest(Request):
    """Asks which models the daemon runs with; with `file` the daemon adopts that one first.

    With a file the answer comes when it has been read and tried, and the next cycle uses it; or an error with the code
    `model_refused` comes, and nothing has changed. An adopted model survives a crash of the loop and lasts until the
    daemon starts anew. Only clients of the Unix socket may ask, because request and answer name files of the daemon's
    computer.
    """

    wire_name = "MODEL"
    reply = ModelKeys
    asker = Asker.LOCAL
    refusal = "models are asked for and adopted over the Unix socket only"
    file: str = Field(
        default="", description='absolute path of a model file to adopt, "" for none; left out: only tell the models'
    )
    shadow: bool = Field(default=False, description="true: compute this model's correction and do not apply it")

    @field_validator("file")
    @classmethod
    def _absolute(cls, file: str) -> str:
        if file and (not file.startswith("/") or _NOT_IN_PATHS.search(file)):
            raise ValueError(f'file is {file[:200]!r}, allowed: an absolute path, or "" for none')
        return file

    @model_validator(mode="after")
    def _named(self) -> Self:
        if self.model_fields_set == {"shadow"}:
            raise ValueError("needs file, a text (shadow: true or false)")
        return self

    def answer(self, requests: Requests, client: ClientSession, send_later: SendLater) -> bytes:
        if requests.switch_model is None:
            raise ProtocolError(ErrorCode.UNIX_ONLY, self.refusal)
        if self.model_fields_set:
            requests.switch_model(self.file, self.shadow, send_later)
            return b""
        return line({"class": self.wire_name, **requests.models()})


REQUESTS: Mapping[str, type[Request]] = {kind.wire_name: kind for kind in Request.__subclasses__()}
_SENT: tuple[type[SentMessage], ...] = (
    *(kind.reply for kind in REQUESTS.values() if kind.reply is not None),
    ErrorKeys,
    SetpointKeys,
    ReadingsKeys,
)
SENT_MESSAGES: Mapping[str, type[SentMessage]] = {kind.wire_name: kind for kind in _SENT}


class Requests:
    """Reads and answers requests, and remembers which client is the controller.

    Runs on the publisher's thread, and is the only writer of `commands.target`.
    """

    def __init__(
        self,
        version: Mapping[str, Any],
        target_keys: TargetKeys,
        commands: Commands,
        status: Callable[[], Mapping[str, Any]],
        take_zero: Callable[[SendLater], None],
        readings: ReadingsMessage | None = None,
        switch_model: Callable[[str, bool, SendLater], None] | None = None,
        models: Callable[[], Mapping[str, Any]] = dict,
    ) -> None:
        """`version`: the VERSION message; `status`: makes the STATUS message; `readings`: makes READINGS messages;
        `models`: summary of the models.

        `take_zero` starts to take machine zero, `switch_model` (file, shadow) to adopt a model; both answer later,
        and raise ProtocolError (busy) while another such request is being worked on.
        """
        self.version = line(version)
        self.target_keys = target_keys
        self.commands = commands
        self.status = status
        self.take_zero = take_zero
        self.readings = readings
        self.switch_model = switch_model
        self.models = models
        self.controller: ClientSession | None = None

    def answer(self, client: ClientSession, data: bytes, send_later: SendLater) -> bytes:
        """The answer to one line; b"" where there is none or it comes by `send_later`.

        Raises ProtocolError for a request that cannot be followed.
        """
        request = self._read(data)
        if request.asker is Asker.CONTROLLER and self.controller is not client:
            raise ProtocolError(ErrorCode.NOT_CONTROLLER, request.refusal)
        if request.asker is Asker.LOCAL and not client.local:
            raise ProtocolError(ErrorCode.UNIX_ONLY, request.refusal)
        return request.answer(self, client, send_later)

    def release(self, client: ClientSession) -> None:
        """Take the controller's role from `client`, if it has it: without a controller the mode is CMM."""
        if self.controller is client:
            self.controller = None
            self.commands.target = None

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
            raise bad_message(error, name, kind.allowed_keys(self)) from error
