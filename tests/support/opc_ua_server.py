"""A real OPC UA server for tests, on a port of this computer: asyncua's, in a thread with a loop of its own."""

from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import Coroutine, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

from asyncua import Server, ua
from asyncua.crypto.permission_rules import User, UserRole
from asyncua.crypto.truststore import TrustStore
from asyncua.crypto.validator import CertificateValidator, CertificateValidatorOptions
from asyncua.server.user_managers import UserManager

from tests.support.certificates import Certificate
from tests.support.patience import PATIENCE_S
from tests.support.ports import free_port

NAMESPACE = "http://compd.example/probes"
NAMESPACE_INDEX = 2  # the first that a server gives

logging.getLogger("asyncua").setLevel(logging.CRITICAL)


@dataclass(frozen=True)
class Security:
    """What a server has that offers signed and encrypted channels alone: its certificate, and one that it trusts."""

    own: Certificate
    trusted: Certificate


class OneUser(UserManager):
    """compd, with its password, and nobody else."""

    def get_user(
        self, iserver: Any, username: str | None = None, password: str | None = None, certificate: Any = None
    ) -> User | None:
        return User(role=UserRole.User) if (username, password) == ("compd", "open sesame") else None


class OpcUaServer:
    """Nodes ns=2;s=NAME with values, statuses and times that a test writes."""

    def __init__(self, users: UserManager | None = None, security: Security | None = None) -> None:
        self.endpoint = f"opc.tcp://127.0.0.1:{free_port()}/probes"
        self._users = users
        self._security = security
        self._runner = asyncio.Runner(loop_factory=asyncio.new_event_loop)
        self._loop = self._runner.get_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="opc ua server", daemon=True)
        self._thread.start()
        self._server: Server | None = None
        self._may_run = threading.Event()
        self._may_run.set()

    def start(self) -> None:
        self._do(self._start())

    def stop(self) -> None:
        """Close every connection, as a server that is restarted."""
        if self._server is not None:
            self._do(self._server.stop())

    def close(self) -> None:
        self.go_on()
        self.stop()
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(PATIENCE_S)
        self._runner.close()  # with the tasks that asyncua leaves of sessions whose clients have not closed them

    def pause(self) -> None:
        """Let it stand still, its connections open."""
        self._may_run.clear()
        stands = threading.Event()

        def stand() -> None:
            stands.set()
            self._may_run.wait()

        self._loop.call_soon_threadsafe(stand)
        assert stands.wait(PATIENCE_S)

    def go_on(self) -> None:
        self._may_run.set()

    def write(
        self,
        name: str,
        value: Any,
        kind: ua.VariantType | None = None,
        status: int = ua.StatusCodes.Good,
        age_s: float | None = 0.0,
    ) -> None:
        """A new value, measured `age_s` ago (s) by its source; None: its source gives no time.

        The first value of a node is of the kind that it has for ever.
        """
        when = None if age_s is None else (datetime.now(UTC) - timedelta(seconds=age_s)).replace(tzinfo=None)
        data = ua.DataValue(ua.Variant(value, kind), ua.StatusCode(status), SourceTimestamp=when)
        self._do(self._write(name, data))

    def _do(self, work: Coroutine[Any, Any, Any]) -> Any:
        return asyncio.run_coroutine_threadsafe(work, self._loop).result(PATIENCE_S)

    async def _start(self) -> None:
        if self._server is None:
            self._server = await self._made()
        await self._server.start()

    async def _made(self) -> Server:
        server = Server(user_manager=self._users)
        await server.init()  # takes two seconds of a processor
        server.set_endpoint(self.endpoint)
        if self._security is None:
            server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
        else:
            await _secure(server, self._security)
        assert await server.register_namespace(NAMESPACE) == NAMESPACE_INDEX
        return server

    async def _write(self, name: str, data: ua.DataValue) -> None:
        assert self._server is not None
        node_id = ua.NodeId(name, NAMESPACE_INDEX)
        if node_id not in self._server.iserver.aspace:
            parent = self._server.nodes.objects
            await parent.add_variable(node_id, ua.QualifiedName(name, NAMESPACE_INDEX), data.Value)
        await self._server.iserver.write_attribute_value(node_id, data)


async def _secure(server: Server, security: Security) -> None:
    server.set_security_policy(
        [
            ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt,
            ua.SecurityPolicyType.Aes256Sha256RsaPss_Sign,
        ]
    )
    await server.load_certificate(security.own.der)
    await server.load_private_key(security.own.key)
    trusted = security.trusted.der.parent / "trusted"
    trusted.mkdir()
    (trusted / security.trusted.der.name).write_bytes(security.trusted.der.read_bytes())
    store = TrustStore([trusted], [])
    await store.load_trust()
    options = CertificateValidatorOptions.TRUSTED_VALIDATION | CertificateValidatorOptions.PEER_CLIENT
    server.set_certificate_validator(CertificateValidator(options, store))


@contextmanager
def running_server(users: UserManager | None = None, security: Security | None = None) -> Iterator[OpcUaServer]:
    server = OpcUaServer(users, security)
    server.start()
    try:
        yield server
    finally:
        server.close()
