"""The simulated machine's gauges as nodes of an OPC UA server on this computer."""

from __future__ import annotations

import asyncio
import logging
import socket
import threading
import time
from collections.abc import Coroutine, Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from asyncua import ua
from asyncua.server.server import Server
from asyncua.ua.status_codes import StatusCodes

from compd.twins import LOOPBACK, WRONG_TYPE, SimulatedPushedDevice, SimulatedPushedLine, is_off

for _name in ("asyncua.server", "asyncua.client"):
    logging.getLogger(_name).setLevel(logging.CRITICAL)

FIRST_NAMESPACE = 2  # 0 is that of OPC UA, 1 that of the server itself
_NAMESPACE = "nsu="
BAD_STATUS, UNCERTAIN_STATUS = "bad status", "uncertain status"
STATUSES: Mapping[str, int] = {
    BAD_STATUS: StatusCodes.BadNoCommunication,
    UNCERTAIN_STATUS: StatusCodes.UncertainLastUsableValue,
}


class OpcUaNodes(SimulatedPushedLine):
    """An OPC UA server with a node for each of the gauges' values, and their times."""

    kind = "opc_ua"
    own_faults = tuple(STATUSES)

    def __init__(self, name: str, devices: Sequence[SimulatedPushedDevice]) -> None:
        super().__init__(name, devices)
        with socket.socket() as free:
            free.bind((LOOPBACK, 0))
            self._port: int = free.getsockname()[1]
        self._runner = asyncio.Runner(loop_factory=asyncio.new_event_loop)
        self._loop = self._runner.get_loop()
        self._loop_thread = threading.Thread(
            target=self._loop.run_forever, name=f"simulated {name} server", daemon=True
        )
        self._server: Server | None = None
        self._node_ids: dict[str, ua.NodeId] = {}

    @property
    def port(self) -> str:
        return f"opc.tcp://{LOOPBACK}:{self._port}/simulated"

    def stop(self) -> None:
        super().stop()
        if self._loop_thread.ident is not None:
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._loop_thread.join()
        self._runner.close()  # with the tasks that asyncua leaves of sessions whose clients have not closed them

    def plug_in(self) -> None:
        if self._loop_thread.ident is None:
            self._loop_thread.start()
        self._do(self._start())

    def pull_out(self) -> None:
        if self._server is not None:
            self._do(self._server.stop())

    def send(self, values: Mapping[str, Any], utc_s: float, fault: str | None = None) -> None:
        self._do(self._write(values, utc_s, fault))

    def _do(self, work: Coroutine[Any, Any, None]) -> None:
        asyncio.run_coroutine_threadsafe(work, self._loop).result()

    async def _start(self) -> None:
        if self._server is None:
            self._server = Server()
            await self._server.init()
            self._server.set_endpoint(self.port)
            self._server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
        utc_s = time.time()
        for device in self._devices:  # a client that comes at once finds every node
            await self._write(device.say(utc_s), utc_s)
        await self._server.start()

    async def _write(self, values: Mapping[str, Any], utc_s: float, fault: str | None = None) -> None:
        assert self._server is not None
        now = datetime.fromtimestamp(utc_s, UTC)
        when = ua.DateTime(now.year, now.month, now.day, now.hour, now.minute, now.second, now.microsecond)
        for node, value in values.items():
            usual = StatusCodes.BadSensorFailure if is_off(value) else StatusCodes.Good
            status = ua.StatusCode(ua.UInt32(STATUSES.get(fault or "", usual)))
            number = ua.Variant(_of_other_rank(value) if fault == WRONG_TYPE else value, ua.VariantType.Double)
            if node not in self._node_ids:
                self._node_ids[node] = await self._added(node, number)
            data = ua.DataValue(number, status, SourceTimestamp=when)
            await self._server.iserver.write_attribute_value(self._node_ids[node], data)

    async def _added(self, node: str, number: ua.Variant) -> ua.NodeId:
        """The id of a new node; namespaces before its own get names, too."""
        assert self._server is not None
        if node.startswith(_NAMESPACE):
            uri, _, rest = node.removeprefix(_NAMESPACE).partition(";")
            node = f"ns={await self._server.register_namespace(uri)};{rest}"
        node_id = ua.NodeId.from_string(node)
        for index in range(FIRST_NAMESPACE, node_id.NamespaceIndex + 1):
            if index >= len(await self._server.get_namespace_array()):
                await self._server.register_namespace(f"urn:compd:simulated:{index}")
        name = ua.QualifiedName(str(node_id.Identifier), node_id.NamespaceIndex)
        await self._server.nodes.objects.add_variable(node_id, name, number)
        return node_id


def _of_other_rank(value: Any) -> Any:
    """An array in place of a number, and a number in place of an array."""
    return value[0] if isinstance(value, list) else [value]
