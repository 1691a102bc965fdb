"""What a client may ask of the daemon: one class per request, with its keys, who may ask, and its answer.

To add a request, derive a class from `Request` here, add a method to `compd.client.Client`, and test both. The class
gives the name on the wire, the keys as pydantic fields (checked strictly, unknown keys refused), `answer`, and the keys
of the answer's message.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, Literal

import structlog
from pydantic import Field, ValidationError

from compd.clock import Clock, MonotonicClock
from compd.configuration.operation import TargetSettings
from compd.live.loop.commands import Commands, Target
from compd.live.service import local_requests
from compd.live.service.client_session import ClientSession, Stream
from compd.live.service.message_keys import (
    ErrorKeys,
    Keys,
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
from compd.live.service.request import Asker, Request, SendLater, TargetKeys
from compd.live.service.tcp_access import TcpAccess

Coordinate = Annotated[float, Field(ge=-LARGEST_NUMBER, le=LARGEST_NUMBER)]
Vector = Annotated[list[Coordinate], Field(min_length=3, max_length=3)]

_log = structlog.get_logger()


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

    The first client that sends a valid one is the controller, until it sends `RELEASE`, a client of the Unix socket
    does, or its connection ends. A target may be used for `sockets.target.valid_for_s`: repeat it, also while the
    machine stands still. Which of the two tips it gives depends on where the machine has its tool.
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
        rotation = self.rotation_B0_rad
        requests.set_target(client, tuple(tip_mm), None if rotation is None else tuple(rotation))
        return b""


class ReleaseKeys(SentMessage):
    """Answers RELEASE: the mode is CMM again."""

    wire_name = "RELEASE"


class ReleaseRequest(Request):
    """Gives the controller's role back: the mode is CMM again.

    A client of the Unix socket ends with it the role of whoever has it. A controller that loses its role in this way
    gets the error `role_taken` for every further `TARGET`, until it connects again.
    """

    wire_name = "RELEASE"
    reply = ReleaseKeys
    asker = Asker.CONTROLLER
    refusal = "only the controller, or a client of the Unix socket, can end the controller's role"

    def answer(self, requests: Requests, client: ClientSession, send_later: SendLater) -> bytes:
        requests.end_role(client)
        return line({"class": self.wire_name})


class AuthKeys(SentMessage):
    """Greets a TCP client in place of VERSION where a token is configured: send AUTH with it."""

    wire_name = "AUTH"


class AuthRequest(Request):
    """Shows that this client may use TCP; the first line of every client where a token is configured.

    The daemon greets such a client with `AUTH` in place of `VERSION`. With a wrong token, or without one, the
    connection is closed.
    """

    wire_name = "AUTH"
    reply = VersionKeys
    token: str = Field(description="what is in the file `sockets.tcp.token_file`", repr=False)

    def answer(self, requests: Requests, client: ClientSession, send_later: SendLater) -> bytes:
        requests.authorize(client, self.token)
        return requests.version


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


# Those of any client first, whatever the order of the modules.
_KINDS = sorted(Request.__subclasses__(), key=lambda kind: kind.__module__ == local_requests.__name__)
REQUESTS: Mapping[str, type[Request]] = {kind.wire_name: kind for kind in _KINDS}
_SENT: tuple[type[SentMessage], ...] = (
    *(kind.reply for kind in REQUESTS.values() if kind.reply is not None),
    AuthKeys,
    ErrorKeys,
    SetpointKeys,
    ReadingsKeys,
)
SENT_MESSAGES: Mapping[str, type[SentMessage]] = {kind.wire_name: kind for kind in _SENT}


def _accept_nothing(gauge: str) -> Sequence[str]:
    return ()


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
        take_zero: Callable[[bool, SendLater], None],
        readings: ReadingsMessage | None = None,
        switch_model: Callable[[str, bool, int, SendLater], None] | None = None,
        models: Callable[[], Mapping[str, Any]] = dict,
        accept: Callable[[str], Sequence[str]] = _accept_nothing,
        targets: TargetSettings | None = None,
        access: TcpAccess | None = None,
        clock: Clock | None = None,
    ) -> None:
        """`version`: the VERSION message; `status`: makes the STATUS message; `readings`: makes READINGS messages;
        `models`: summary of the models; `targets`: how long a target may be used, and who may give one.

        `take_zero` (whether to replace one that differs) starts to take machine zero, `switch_model` (file, shadow,
        user who asks) to adopt a model; both answer later, and raise ProtocolError (busy) while another such request is
        being worked on. `accept` makes the acquisition believe a gauge, "gauge.channel" or "all" again, and returns the
        channels that it did not believe; it raises ValueError, with a text for the client, for a name that is none.
        `access`: who may use TCP; None: everybody who reaches it.
        """
        self.version = line(version)
        self.target_keys = target_keys
        self.commands = commands
        self.status = status
        self.take_zero = take_zero
        self.readings = readings
        self.switch_model = switch_model
        self.models = models
        self.accept = accept
        self.controller: ClientSession | None = None
        self._targets = targets or TargetSettings()
        self._access = access
        self._clock = clock or MonotonicClock()

    def greeting(self, client: ClientSession) -> bytes:
        """The first line for a client: VERSION, or AUTH where it has to show a token."""
        client.authorized = client.local or self._access is None or not self._access.needs_token
        return self.version if client.authorized else line({"class": AuthKeys.wire_name})

    def admits(self, address: str) -> bool:
        """Whether a client at this IP address may connect over TCP at all."""
        return self._access is None or self._access.admits(address)

    def authorize(self, client: ClientSession, token: str) -> None:
        """Let a client in that shows the token. Raises ProtocolError (not_authorized) for another one."""
        if client.authorized:
            return
        if self._access is None or not self._access.knows(token):
            raise ProtocolError(ErrorCode.NOT_AUTHORIZED, "this is not the token")
        client.authorized = True

    def answer(self, client: ClientSession, data: bytes, send_later: SendLater) -> bytes:
        """The answer to one line; b"" where there is none or it comes by `send_later`.

        Raises ProtocolError for a request that cannot be followed.
        """
        request = self._read(data)
        if not client.authorized and not isinstance(request, AuthRequest):
            raise ProtocolError(ErrorCode.NOT_AUTHORIZED, "the first line must be AUTH with the token")
        if request.asker is Asker.CONTROLLER and self.controller is not client and not client.local:
            raise ProtocolError(ErrorCode.NOT_CONTROLLER, request.refusal)
        if request.asker is Asker.LOCAL and not client.local:
            raise ProtocolError(ErrorCode.UNIX_ONLY, request.refusal)
        return request.answer(self, client, send_later)

    def set_target(
        self, client: ClientSession, tip_mm: tuple[float, ...], rotation_B0_rad: tuple[float, ...] | None
    ) -> None:
        """Take a target, and with it `client` as the controller. Raises ProtocolError where it may not be."""
        if self._targets.unix_only and not client.local:
            raise ProtocolError(
                ErrorCode.UNIX_ONLY, "targets are given over the Unix socket only (sockets.target.unix_only)"
            )
        if client.lost_role:
            raise ProtocolError(
                ErrorCode.ROLE_TAKEN, "the role was taken from this client over the Unix socket: connect again"
            )
        if self.controller not in {None, client}:
            raise ProtocolError(ErrorCode.ROLE_TAKEN, "another client is the controller")
        if self.controller is None:
            _log.info("controller", client=client.name)
        self.controller = client
        valid_until_s = self._clock.monotonic() + self._targets.valid_for_s
        self.commands.target = Target(tip_mm, rotation_B0_rad, valid_until_s)

    def end_role(self, client: ClientSession) -> None:
        """End the controller's role, which `client` has or, over the Unix socket, takes from whoever has it.

        Raises ProtocolError (not_controller) where nobody has it.
        """
        controller = self.controller
        if controller is None:
            raise ProtocolError(ErrorCode.NOT_CONTROLLER, "no client is the controller")
        if controller is not client:
            controller.lost_role = True
            _log.warning("the controller has lost its role", client=controller.name, by=client.name)
        self.release(controller)

    def release(self, client: ClientSession) -> None:
        """Take the controller's role from `client`, if it has it: without a controller the mode is CMM."""
        if self.controller is client:
            self.controller = None
            self.commands.target = None
            _log.info("no controller any more", client=client.name)

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
