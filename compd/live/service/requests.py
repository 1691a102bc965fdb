"""What clients ask for, and who may: watching, the controller role, status, machine zero, models."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from compd.live.loop.commands import Commands
from compd.live.loop.setpoint import Setpoint
from compd.live.service.client_session import MAX_BEHIND_BYTES, MAX_READINGS_BEHIND_BYTES, ClientSession
from compd.live.service.messages import (
    ErrorCode,
    ModelOrder,
    ProtocolError,
    TargetKeys,
    line,
    parse,
    parse_bare,
    parse_model,
    parse_target,
    parse_watch,
)
from compd.live.service.readings_message import ReadingsMessage

# Takes a function that answers the client later, from any thread. Raises ProtocolError (busy).
TakeZero = Callable[[Callable[[bytes], None]], None]
TakeModel = Callable[[ModelOrder, Callable[[bytes], None]], None]


class Requests:
    """Answers messages. Runs on the publisher's thread, and is the only writer of the target."""

    def __init__(
        self,
        version: Mapping[str, Any],
        target_keys: TargetKeys,
        commands: Commands,
        status: Callable[[], Mapping[str, Any]],
        take_zero: TakeZero,
        transcript: ReadingsMessage | None = None,
        take_model: TakeModel | None = None,
    ) -> None:
        """`version`: the VERSION message; `status`: makes the STATUS message; `transcript`: READINGS messages.

        `take_model`: adopts a model file, or runs it as a shadow.
        """
        self.version = line(version)
        self._target_keys = target_keys
        self._commands = commands
        self._status = status
        self._take_zero = take_zero
        self._transcript = transcript
        self._take_model = take_model
        self._controller: ClientSession | None = None

    def answer(self, session: ClientSession, data: bytes, later: Callable[[bytes], None]) -> bytes:
        """The answer to one line, b"" where there is none; `later` sends one that takes time.

        Raises ProtocolError for a message that cannot be followed.
        """
        message = parse(data)
        match message["class"]:
            case "WATCH":
                return self._watch(session, message)
            case "TARGET":
                target = parse_target(message, self._target_keys)
                if self._controller not in {None, session}:
                    raise ProtocolError(ErrorCode.ROLE_TAKEN, "another client is the controller")
                self._controller = session
                self._commands.target = target
                return b""
            case "RELEASE":
                parse_bare(message)
                if self._controller is not session:
                    raise ProtocolError(ErrorCode.NOT_CONTROLLER, "only the controller can release its role")
                self.left(session)
                return line({"class": "RELEASE"})
            case "STATUS":
                parse_bare(message)
                return line(self._status())
            case "VERSION":
                parse_bare(message)
                return self.version
            case "ZERO":
                parse_bare(message)
                if not session.local:
                    raise ProtocolError(ErrorCode.UNIX_ONLY, "machine zero is taken over the Unix socket only")
                self._take_zero(later)
                return b""
            case "MODEL":
                return self._model(session, message, later)
            case unknown:
                raise ProtocolError(
                    ErrorCode.UNKNOWN_CLASS,
                    f"class {unknown[:40]!r}, allowed: WATCH, TARGET, RELEASE, STATUS, VERSION, ZERO, MODEL",
                )

    def _watch(self, session: ClientSession, message: Mapping[str, Any]) -> bytes:
        rate_hz, readings = parse_watch(message)
        answer = {key: message[key] for key in ("class", "what", "rate_hz") if key in message}
        if not readings:
            session.watch(rate_hz, Setpoint.to_json, MAX_BEHIND_BYTES)
            return line(answer)
        if not session.local or self._transcript is None:
            # several times a setpoint's size, and of use beside the daemon only: its times are this computer's
            raise ProtocolError(ErrorCode.UNIX_ONLY, "readings are watched over the Unix socket only")
        session.watch(rate_hz, self._transcript.line, MAX_READINGS_BEHIND_BYTES)
        return line(answer | {"columns": self._transcript.columns})

    def _model(self, session: ClientSession, message: Mapping[str, Any], later: Callable[[bytes], None]) -> bytes:
        order = parse_model(message)
        if not session.local or self._take_model is None:
            # an order names a file of this computer, and so does the answer
            raise ProtocolError(ErrorCode.UNIX_ONLY, "models are asked for and adopted over the Unix socket only")
        if order is None:
            models = self._commands.models
            return line({"class": "MODEL", **({} if models is None else models.summary)})
        self._take_model(order, later)
        return b""

    def left(self, session: ClientSession) -> None:
        """A client has gone or gives its role back: without a controller the mode is CMM."""
        if self._controller is session:
            self._controller = None
            self._commands.target = None

    @property
    def controlled(self) -> bool:
        """Some client is the controller."""
        return self._controller is not None
