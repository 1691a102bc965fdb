"""Who may use the TCP port: addresses that are allowed, and a token that every client shows first."""

from __future__ import annotations

import hmac
import ipaddress
import os
import stat
from pathlib import Path

from compd.errors import DaemonError
from compd.files import read_small_file
from compd.operation_settings import TcpSocket

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
