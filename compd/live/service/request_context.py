"""What requests work on: the daemon's answers and errands, and which client is the controller."""

from __future__ import annotations

import hmac
import ipaddress
import os
import stat
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import structlog

from compd.clock import Clock
from compd.errors import DaemonError
from compd.files import read_small_file
from compd.live.loop import Commands, Target
from compd.live.service.client_session import ClientSession
from compd.live.service.message_keys.answers import AcceptKeys
from compd.live.service.messages import ErrorCode, ProtocolError, line
from compd.live.service.model_switch import ModelWish
from compd.live.service.readings_message import ReadingsMessage
from compd.operation_settings import TargetSettings, TcpSocket

# 16 characters of base64 are 96 bits: not to be guessed at one try in a second.
_MIN_TOKEN = 16
_MAX_TOKEN_BYTES = 1024
_MAKE_ONE = "make one: (umask 077; openssl rand -base64 32 > {path}), owned by the daemon's user"


class TcpAccess:
    """The addresses that may connect, and the token; neither is kept anywhere else."""

    def __init__(self, settings: TcpSocket) -> None:
        """Raises DaemonError for a token file that cannot be used."""
        self._networks = [ipaddress.ip_network(text) for text in settings.allow]
        self._token = b"" if settings.token_file is None else read_token(Path(settings.token_file))

    @staticmethod
    def of(settings: TcpSocket | None) -> TcpAccess | None:
        """The rules of a configuration; None where it has none, and whoever reaches the port is let in."""
        return None if settings is None or not (settings.allow or settings.token_file) else TcpAccess(settings)

    @property
    def needs_token(self) -> bool:
        """Whether a client has to show a token."""
        return bool(self._token)

    def admits(self, address: str) -> bool:
        """Whether a client at this IP address may connect."""
        ip = ipaddress.ip_address(address.partition("%")[0])
        if isinstance(ip, ipaddress.IPv6Address) and ip.ipv4_mapped is not None:
            ip = ip.ipv4_mapped
        return not self._networks or any(ip in network for network in self._networks)

    def knows(self, token: str) -> bool:
        """Whether this is the token; it takes as long for a token that is nearly right as for any other."""
        return hmac.compare_digest(token.encode("utf-8", "surrogatepass"), self._token)


def read_token(path: Path) -> bytes:
    """The token in a file that nobody but its owner may read.

    Raises DaemonError where there is none, it is too short, or others may read it.
    """

    def refused(what: str, value: str = "", allowed: str = "") -> DaemonError:
        next_step = _MAKE_ONE.format(path=path)
        where = f"sockets.tcp.token_file {path}"
        return DaemonError.of(where, what, value=value, allowed=allowed, next_step=next_step)

    try:
        status = path.stat()
        content = read_small_file(path, _MAX_TOKEN_BYTES)
    except OSError as error:
        raise refused(f"cannot be read: {error.strerror}") from error
    if status.st_mode & (stat.S_IRWXG | stat.S_IRWXO):
        raise refused("may be read by others than its owner", f"mode {status.st_mode & 0o777:o}", "mode 600")
    if status.st_uid not in {0, os.geteuid()}:
        raise refused("belongs to another user", f"user {status.st_uid}", "root, or the daemon's user")
    token = content.strip()
    if len(token) < _MIN_TOKEN:
        raise refused("is too short for a token", f"{len(token)} characters", f"{_MIN_TOKEN} or more")
    return token


# Sends a line to the client that asked, from any thread: the answer to a request that takes time.
SendLater = Callable[[bytes], None]

_log = structlog.get_logger()


@dataclass(frozen=True)
class TargetKeys:
    """Which keys TARGET has on this machine.

    tip : "tip_B0_mm", or "tip_P_mm" with the tool on the plate; "" where the machine takes no target.
    rotation : whether "rotation_B0_rad" is allowed: a hexapod's attitude is free, a tripod's follows from its tip.
    scales : number of scales by which "tip_by_scale" says how the tip moves; 0 where that key is not allowed.
    """

    tip: Literal["tip_B0_mm", "tip_P_mm", ""]
    rotation: bool
    scales: int = 0

    @property
    def names(self) -> tuple[str, ...]:
        optional = {"rotation_B0_rad": self.rotation, "tip_by_scale": bool(self.scales)}
        return (*filter(None, [self.tip]), *(name for name, allowed in optional.items() if allowed), "time_s", "id")


def _accept_nothing(gauge: str, send_later: SendLater) -> None:
    send_later(AcceptKeys.line(gauges=[]))


def _tell_nobody(order: bytes) -> None:
    return


def _poll_nothing(gauge: str) -> None:
    return


@dataclass(frozen=True, kw_only=True)
class Messages:
    """The messages that answer a request at once.

    version, machine : the messages themselves.  status, budget : make theirs.
    models : makes the summary of the models.  readings : makes READINGS messages; None where nobody records.
    """

    version: Mapping[str, Any]
    machine: Mapping[str, Any]
    status: Callable[[], Mapping[str, Any]]
    budget: Callable[[], Mapping[str, Any]]
    models: Callable[[], Mapping[str, Any]] = dict
    readings: ReadingsMessage | None = None


@dataclass(frozen=True, kw_only=True)
class Errands:
    """What a request may have done. What takes time answers later.

    take_zero : starts to take machine zero; is told whether to replace one that differs.
    switch_model : starts to adopt a model; is given what is asked for, and what gives the descriptor that came with it.
        Both raise ProtocolError (busy) while another such request is being worked on.
    accept : makes the acquisition believe a gauge, "gauge.channel" or "all" again.  poll : has a gauge polled at once.
        Both raise ValueError, with a text for the client, for a name that is none.
    tell_order : gets an ORDER line for whoever records, from any thread.
    """

    take_zero: Callable[[bool, SendLater], None]
    switch_model: Callable[[ModelWish, Callable[[], int | None], SendLater], None] | None = None
    accept: Callable[[str, SendLater], None] = _accept_nothing
    poll: Callable[[str], None] = _poll_nothing
    tell_order: Callable[[bytes], None] = _tell_nobody


class RequestContext:
    """What a request may use to answer; on the publisher's thread, the only writer of `commands.target`."""

    def __init__(
        self,
        *,
        messages: Messages,
        errands: Errands,
        commands: Commands,
        target_keys: TargetKeys,
        clock: Clock,
        targets: TargetSettings | None = None,
        access: TcpAccess | None = None,
    ) -> None:
        """`targets`: how long a target may be used, and who may give one; `access`: who may use TCP, None for everybody
        who reaches it."""
        self.messages = messages
        self.errands = errands
        self.version = line(messages.version)  #: version, machine: these messages as lines
        self.machine = line(messages.machine)
        self.target_keys = target_keys
        self.commands = commands
        self.controller: ClientSession | None = None  #: the client that gives targets; None for none
        self._targets = targets or TargetSettings()
        self.access = access
        self.clock = clock

    def authorize(self, client: ClientSession, token: str) -> None:
        """Let a client in that shows the token. Raises ProtocolError (not_authorized) for another one."""
        if client.authorized:
            return
        if self.access is None or not self.access.knows(token):
            raise ProtocolError(ErrorCode.NOT_AUTHORIZED, "this is not the token")
        client.authorized = True

    def set_target(self, client: ClientSession, target: Target) -> None:
        """Take a target, which says when it was made, and with it `client` as the controller.

        Raises ProtocolError where it may not be.
        """
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
        self.commands.target = replace(target, valid_until_s=target.time_s + self._targets.valid_for_s)

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
