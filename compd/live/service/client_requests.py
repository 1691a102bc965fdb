"""What any client may ask: setpoints and readings, targets, the daemon's status and version."""

from __future__ import annotations

import math
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from compd.live.loop import Target
from compd.live.service.client_session import ClientSession, Place, Stream
from compd.live.service.message_keys.answers import ReleaseKeys
from compd.live.service.message_keys.budget import BudgetKeys
from compd.live.service.message_keys.machine import MachineKeys
from compd.live.service.message_keys.message import Keys, SentMessage, VersionKeys, absent, present
from compd.live.service.message_keys.status import StatusKeys
from compd.live.service.messages import MAX_NUMBER, ErrorCode, ProtocolError, line, unknown_key
from compd.live.service.order import OrderRequest
from compd.live.service.request import Asker, Request
from compd.live.service.request_context import RequestContext, SendLater

# Every program has whole numbers up to here exactly: 2 to the power of 53.
MAX_ID = 2**53
Coordinate = Annotated[float, Field(ge=-MAX_NUMBER, le=MAX_NUMBER)]
Vector = Annotated[list[Coordinate], Field(min_length=3, max_length=3)]
TipByScale = Annotated[
    list[Annotated[list[Coordinate], Field(min_length=1, max_length=6)]], Field(min_length=3, max_length=6)
]


class ColumnKeys(Keys):
    """One column of a recording: sign * (value - machine zero) for a length, the value itself for anything else."""

    column: str = present("the column's name, which ends in its unit")
    channel: str = present('the gauge\'s channel, "gauge.channel", as in READINGS')
    sign: Literal[1, -1] | None = absent("lengths: -1 where the display falls as it grows")
    stale_after_s: float = present("a reading older than this is stale, s")


class WatchKeys(SentMessage):
    """Answers WATCH, with the keys of the request."""

    wire_name = "WATCH"
    what: Literal["setpoints", "readings"] | None = absent("as in the request")
    rate_hz: float | None = absent("as in the request, Hz")
    columns: list[ColumnKeys] | None = absent("of readings: which channel is which column")
    model_columns: list[str] | None = absent(
        "of readings, with `machine: external` and without scales: columns that are made of the setpoints"
    )
    rotation_B0_in_M_rad: list[float] | None = absent(
        "of readings, without scales: the attitude of {B0} in {M}, as a rotation vector, rad"
    )


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
    rate_hz: Annotated[int | float, Field(ge=0, le=MAX_NUMBER)] = Field(
        default=math.inf, description="messages per second (Hz); left out: one for every cycle; 0: none"
    )

    def answer(self, context: RequestContext, client: ClientSession, send_later: SendLater) -> bytes:
        asked = self.model_dump(exclude_unset=True)
        if self.what == "setpoints":
            client.watch(self.rate_hz, Stream.SETPOINTS)
            return WatchKeys.line(**asked)
        if not client.local or context.messages.readings is None:
            # READINGS are several times a SETPOINT's size, and their times are those of this computer's clock.
            raise ProtocolError(ErrorCode.UNIX_ONLY, "readings are watched over the Unix socket only")
        client.watch(self.rate_hz, Stream.READINGS)
        readings = context.messages.readings
        return WatchKeys.line(**asked, columns=readings.columns, **readings.from_setpoints)


class TargetRequest(Request):
    """Asks for setpoints that bring the tip to this target. There is no answer; the next setpoint is for it.

    The first client that sends a valid one is the controller, until it sends `RELEASE`, a client of the Unix socket
    does, or its connection ends. Of several that wait the newest counts, and the others are not looked at. A target may
    be used for `sockets.target.valid_for_s` from `time_s` on: repeat it, also while the machine stands still. Which of
    the two tips it gives depends on where the machine has its tool.
    """

    wire_name = "TARGET"
    place = Place.NEWEST
    tip_B0_mm: Vector | None = absent("the tip in {B0}, mm: [x, y, z]; tool on the platform")
    tip_P_mm: Vector | None = absent("the touched place in {P}, mm: [x, y, z]; tool on the surface plate")
    rotation_B0_rad: Vector | None = absent(
        "hexapod: rotation vector of {P} in {B0}, rad; left out: the attitude at machine zero"
    )
    tip_by_scale: TipByScale | None = absent(
        "`machine: external` with scales: how much each scale moves the tip, in {M}, mm per mm: 3 rows, x y z, of one "
        "number for each scale; 3 more rows turn what carries the tip about x y z, rad per mm"
    )
    time_s: Coordinate | None = absent(
        "when it was made, s on the daemon's monotonic clock, as in SETPOINT; left out, or later than it comes: when "
        "it comes"
    )
    id: Annotated[int, Field(ge=0, le=MAX_ID)] | None = absent(
        "a number of your own; `target_id` of the setpoints that answer it"
    )

    @classmethod
    def allowed_keys(cls, context: RequestContext) -> tuple[str, ...]:
        return context.target_keys.names

    def answer(self, context: RequestContext, client: ClientSession, send_later: SendLater) -> bytes:
        keys = context.target_keys
        if not keys.tip:
            raise ProtocolError(
                ErrorCode.BAD_MESSAGE, "this machine's own kinematics gives the pose: it takes no target"
            )
        if foreign := sorted(self.model_fields_set.difference(keys.names)):
            raise unknown_key(self.wire_name, foreign[0], keys.names)
        made_s = client.arrived_s if self.time_s is None else min(self.time_s, client.arrived_s)
        tip_mm = getattr(self, keys.tip)
        if tip_mm is None:
            raise ProtocolError(ErrorCode.BAD_MESSAGE, f"needs {keys.tip}, three numbers")
        rotation = self.rotation_B0_rad
        rows = self.tip_by_scale
        if keys.scales and (rows is None or any(len(row) != keys.scales for row in rows)):
            raise ProtocolError(
                ErrorCode.BAD_MESSAGE, f"needs tip_by_scale, 3 or 6 rows of {keys.scales} numbers, one for each scale"
            )
        context.set_target(
            client,
            Target(
                tuple(tip_mm),
                None if rotation is None else tuple(rotation),
                time_s=made_s,
                id=self.id,
                tip_by_scale=None if rows is None else tuple(map(tuple, rows)),
            ),
        )
        return b""

    @model_validator(mode="after")
    def _has_rows(self) -> Self:
        if self.tip_by_scale is not None and len(self.tip_by_scale) not in {3, 6}:
            raise ValueError("tip_by_scale has 3 or 6 rows")
        return self


class ReleaseRequest(OrderRequest):
    """Gives the controller's role back: the mode is CMM again.

    A client of the Unix socket ends with it the role of whoever has it. A controller that loses its role in this way
    gets the error `role_taken` for every further `TARGET`, until it connects again.
    """

    wire_name = "RELEASE"
    place = Place.FIXED
    reply = ReleaseKeys
    asker = Asker.CONTROLLER
    refusal = "only the controller, or a client of the Unix socket, can end the controller's role"

    @property
    def subject(self) -> str:
        return ""

    def answer(self, context: RequestContext, client: ClientSession, send_later: SendLater) -> bytes:
        context.end_role(client)
        return ReleaseKeys.line()


class AuthRequest(Request):
    """Shows that this client may use TCP; the first line of every client where a token is configured.

    The daemon greets such a client with `AUTH` in place of `VERSION`. With a wrong token, or without one, the
    connection is closed.
    """

    wire_name = "AUTH"
    reply = VersionKeys
    token: str = Field(description="what is in the file `sockets.tcp.token_file`", repr=False)

    def answer(self, context: RequestContext, client: ClientSession, send_later: SendLater) -> bytes:
        context.authorize(client, self.token)
        return context.version


class StatusRequest(Request):
    """Asks how the daemon, its lines and its gauges are doing."""

    wire_name = "STATUS"
    reply = StatusKeys

    def answer(self, context: RequestContext, client: ClientSession, send_later: SendLater) -> bytes:
        return line(context.messages.status())


class VersionRequest(Request):
    """Asks which daemon, machine and configuration this is. The answer also greets every new client."""

    wire_name = "VERSION"
    reply = VersionKeys

    def answer(self, context: RequestContext, client: ClientSession, send_later: SendLater) -> bytes:
        return context.version


class MachineRequest(Request):
    """Asks for the machine's geometry, limits and wiring. They change only with the configuration."""

    wire_name = "MACHINE"
    reply = MachineKeys

    def answer(self, context: RequestContext, client: ClientSession, send_later: SendLater) -> bytes:
        return context.machine


class BudgetRequest(Request):
    """Asks how far each cause has moved the tip, and where the moving platform is, by the newest setpoint."""

    wire_name = "BUDGET"
    reply = BudgetKeys

    def answer(self, context: RequestContext, client: ClientSession, send_later: SendLater) -> bytes:
        return line(context.messages.budget())
