"""OPC UA, by asyncua: a subscription to the nodes of a server, in the thread of the line, with a loop of its own.

The server looks at each node every `sampling_s`, and answers every Publish request of this client: with what is new, or
after `publishing_s` with a keep-alive that says that nothing is. So an answer tells of the time after its request left,
and what it does not name has not changed since the one before. Where the time of the source does not count, this is the
earliest time of a measurement: that of the request, less the sampling interval.

Where the server allows it, a value with a new time of the source is sent too although it is the same.

Sources: OPC 10000-4 1.05, 5.13 (monitored items), 5.14 (subscriptions, Publish, keep-alive), 7.22.2 (DataChangeFilter).
"""

from __future__ import annotations

import asyncio
import logging
import math
import struct
import time
from collections.abc import Awaitable, Callable, Mapping, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from typing import Any, TypeVar

from asyncua import ua
from asyncua.client.client import Client
from asyncua.ua.attribute_ids import AttributeIds
from asyncua.ua.status_codes import StatusCodes
from asyncua.ua.ua_binary import nodeid_to_binary
from asyncua.ua.uaerrors import UaError, UaStatusCodeError

from compd.clock import Clock
from compd.gauge import LineFault, Quality
from compd.lines.kinds.opc_ua.login import log_in, refusal
from compd.lines.kinds.opc_ua.settings import OpcUaLine
from compd.lines.kinds.opc_ua.status import quality_of
from compd.pushed_gauge import Message
from compd.source_time import Arrival

# Every fault becomes a LineFault and reaches STATUS; asyncua would log each one as well, with its traceback.
logging.getLogger("asyncua").addHandler(logging.NullHandler())
logging.getLogger("asyncua").propagate = False

MS_PER_S = 1e3
# Lifetime (s) of a subscription without a request, after which the server may drop it.
LIFETIME_S = 30.0
# Missed keep-alives in a row, and after the timeout, that show a lost server.
MISSED_KEEP_ALIVES = 3
NOT_FILTERED = (
    StatusCodes.BadMonitoredItemFilterUnsupported,
    StatusCodes.BadMonitoredItemFilterInvalid,
    StatusCodes.BadFilterNotAllowed,
)
_NAMESPACE = "nsu="
ResultT = TypeVar("ResultT")


class OpcUaSubscriber:
    """A `PushedLine` over OPC UA. Used by one thread."""

    last_request_s = -math.inf  # no reading belongs to a request
    unexpected_bytes = 0
    request_came_back = False

    def __init__(self, settings: OpcUaLine, clock: Clock, utc: Callable[[], float] = time.time) -> None:
        """Connect within `settings.timeout_s`, and subscribe to nothing yet. `utc`: the calendar clock, s since 1970.

        Raises LineFault (LINE_LOST) when the server cannot be reached, or refuses.
        """
        self._settings = settings
        self._clock = clock
        self._utc = utc
        self._came: list[Message] = []
        self._last: dict[str, Message] = {}  # by node: what the server said last
        self._node_of: dict[int, str] = {}  # by client handle
        self._sampling_s: dict[str, float] = {}
        self._why_lost = ""
        self._subscription = 0
        self._longest_silence_s = settings.timeout_s
        self._asked_s = clock.monotonic()  # when the Publish request left that is answered next
        self._loop = asyncio.new_event_loop()
        self._news = asyncio.Event()
        self._client = Client(settings.endpoint, timeout=settings.timeout_s)
        self._client.connection_lost_callback = self._note_loss
        try:
            self._run(self._connect(settings))
        except LineFault:
            self.close()
            raise

    def subscribe(self, addresses: Sequence[str]) -> None:
        """Subscribe to nodes, by the text of their ids, but for those that were subscribed to before.

        One that the server refuses sends a message with DEVICE_ERROR, and may be asked for again.

        Raises LineFault (LINE_LOST) if the server does not answer.
        """
        if nodes := [node for node in dict.fromkeys(addresses) if node not in self._sampling_s]:
            self._run(self._monitor(nodes))

    def messages(self, timeout_s: float | None = None) -> Sequence[Message]:
        """See `PushedLine`. Raises LineFault (LINE_LOST)."""
        wait_s = self._settings.timeout_s if timeout_s is None else timeout_s
        with suppress(TimeoutError):
            self._loop.run_until_complete(asyncio.wait_for(self._news.wait(), wait_s))
        self._news.clear()
        came, self._came = self._came, []
        silent_s = self._clock.monotonic() - self._asked_s
        if not came and not self._why_lost and silent_s > self._longest_silence_s:
            self._why_lost = f"its subscription has said nothing for {silent_s:.3g} s, not even a keep-alive"
        if not came and self._why_lost:
            raise LineFault(Quality.LINE_LOST, f"{self._settings.endpoint}: {self._why_lost}")
        return came

    def drain(self, quiet_s: float | None = None) -> bytes:
        """Nothing: no message belongs to a request."""
        return b""

    def close(self) -> None:
        """Close session and connection; a server that does not answer is left."""
        self._client.connection_lost_callback = None
        with suppress(Exception):
            self._loop.run_until_complete(asyncio.wait_for(self._client.disconnect(), self._settings.timeout_s))
        self._loop.run_until_complete(_end_tasks())
        self._loop.close()

    def _run(self, work: Awaitable[ResultT]) -> ResultT:
        """The result of `work`. Raises LineFault (LINE_LOST) for whatever the server or the network does."""
        where, timeout_s = self._settings.endpoint, self._settings.timeout_s
        try:
            return self._loop.run_until_complete(asyncio.wait_for(work, timeout_s))
        except TimeoutError as error:
            raise LineFault(Quality.LINE_LOST, f"{where} has not answered within {timeout_s:g} s") from error
        except UaStatusCodeError as error:
            raise LineFault(Quality.LINE_LOST, f"{where} {refusal(error)}") from error
        except (OSError, UaError, ValueError) as error:
            text = str(error) or type(error).__name__
            raise LineFault(Quality.LINE_LOST, f"cannot connect to {where}: {text}") from error

    async def _connect(self, settings: OpcUaLine) -> None:
        """Connect, log in, and make the subscription."""
        await log_in(self._client, settings)
        self._asked_s = self._clock.monotonic()
        result = await self._client.uaclient.create_subscription(
            ua.CreateSubscriptionParameters(
                RequestedPublishingInterval=settings.publishing_s * MS_PER_S,
                RequestedLifetimeCount=max(10, math.ceil(LIFETIME_S / settings.publishing_s)),
                RequestedMaxKeepAliveCount=1,
                PublishingEnabled=True,
            ),
            self._answered,
        )
        self._subscription = result.SubscriptionId
        keep_alive_s = result.RevisedPublishingInterval / MS_PER_S * max(1, result.RevisedMaxKeepAliveCount)
        self._longest_silence_s = max(settings.timeout_s, MISSED_KEEP_ALIVES * keep_alive_s)

    async def _monitor(self, nodes: Sequence[str]) -> None:
        namespaces = await self._client.get_namespace_array() if any(_NAMESPACE in node for node in nodes) else []
        wanted: dict[str, ua.NodeId] = {}
        for node in nodes:
            try:
                wanted[node] = _node_id(node, namespaces)
            except (UaError, ValueError, struct.error) as error:
                self._refuse(node, str(error))
        results = await self._create_items(wanted, with_times=True)
        plain = {node: wanted[node] for node, result in results.items() if result.StatusCode.value in NOT_FILTERED}
        results.update(await self._create_items(plain, with_times=False))
        for node, result in results.items():
            if not result.StatusCode.is_good():
                self._refuse(node, result.StatusCode.name)
            else:
                # 0 is: as soon as it changes
                self._sampling_s[node] = max(0.0, result.RevisedSamplingInterval / MS_PER_S)

    async def _create_items(
        self, nodes: Mapping[str, ua.NodeId], with_times: bool
    ) -> dict[str, ua.MonitoredItemCreateResult]:
        """The server's answer for each node. with_times : a new time of the source is news, too."""
        if not nodes:
            return {}
        sampling_s = self._settings.sampling_s or self._settings.publishing_s
        filter_ = ua.DataChangeFilter(Trigger=ua.DataChangeTrigger.StatusValueTimestamp) if with_times else None
        items = []
        for node, node_id in nodes.items():
            handle = len(self._node_of) + 1
            self._node_of[handle] = node
            self._sampling_s[node] = sampling_s  # until the server has said what it makes of it
            parameters = ua.MonitoringParameters(
                ClientHandle=handle,
                SamplingInterval=sampling_s * MS_PER_S,
                Filter=filter_,
                QueueSize=1,  # the newest counts
                DiscardOldest=True,
            )
            wanted = ua.ReadValueId(NodeId=node_id, AttributeId=AttributeIds.Value)
            items.append(ua.MonitoredItemCreateRequest(wanted, ua.MonitoringMode.Reporting, parameters))
        request = ua.CreateMonitoredItemsParameters(self._subscription, ua.TimestampsToReturn.Source, items)
        results = await self._client.uaclient.create_monitored_items(request)
        return dict(zip(nodes, results, strict=True))

    def _refuse(self, node: str, why: str) -> None:
        arrival = Arrival(self._clock.monotonic(), self._utc())
        detail = f"{self._settings.endpoint} has no values of {node}: {why}"
        self._came.append(Message(node, None, arrival, math.nan, Quality.DEVICE_ERROR, detail))
        self._sampling_s.pop(node, None)
        self._news.set()

    async def _note_loss(self, error: Exception) -> None:
        self._why_lost = f"the connection is gone: {str(error) or type(error).__name__}"
        self._news.set()

    def _answered(self, result: ua.PublishResult) -> None:
        """Take the answer to a Publish request; called by asyncua, which then sends the next one."""
        arrived_s, arrived_utc_s = self._clock.monotonic(), self._utc()
        asked_s, self._asked_s = self._asked_s, arrived_s
        holds = self._settings.unchanged == "holds"
        fresh: set[str] = set()
        for notification in result.NotificationMessage.NotificationData or ():
            if isinstance(notification, ua.StatusChangeNotification):
                self._why_lost = f"the subscription has ended: {notification.Status.name}"
            elif isinstance(notification, ua.DataChangeNotification):
                for item in notification.MonitoredItems:
                    node = self._node_of.get(item.ClientHandle)
                    if node is None:
                        continue
                    earliest_s = asked_s - self._sampling_s[node]
                    kept = node not in self._last and not holds
                    arrival = Arrival(arrived_s, arrived_utc_s, earliest_s, holds, kept)
                    self._last[node] = _message(node, item.Value, arrival)
                    self._came.append(self._last[node])
                    fresh.add(node)
        if holds:
            for node, last in self._last.items():
                if node not in fresh:
                    arrival = Arrival(arrived_s, arrived_utc_s, asked_s - self._sampling_s[node], holds)
                    self._came.append(last._replace(arrival=arrival))
        if self._came or self._why_lost:
            self._news.set()


async def _end_tasks() -> None:
    """End what asyncua leaves running, and what that has to close."""
    tasks = asyncio.all_tasks() - {asyncio.current_task()}
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    await asyncio.sleep(0)  # transports that are closing do so in the loop


def _message(node: str, value: ua.DataValue, arrival: Arrival) -> Message:
    quality, detail = quality_of(value.StatusCode.value if value.StatusCode is not None else StatusCodes.Good)
    payload: Any = value.Value.Value if value.Value is not None else None
    return Message(node, payload, arrival, _utc_s(value.SourceTimestamp), quality, detail)


def _utc_s(time_: datetime | None) -> float:
    """Seconds since 1970; nan where there is no time, which OPC UA also writes as the year 1601."""
    if time_ is None or time_.year <= 1601:
        return math.nan
    return time_.replace(tzinfo=UTC).timestamp()


def _node_id(node: str, namespaces: Sequence[str]) -> ua.NodeId:
    """The id of a text such as ns=2;s=Probe1, or nsu=http://maker/;s=Probe1 by the name of the namespace."""
    if node.startswith(_NAMESPACE):
        uri, _, rest = node.removeprefix(_NAMESPACE).partition(";")
        if uri not in namespaces:
            raise ValueError(f"it has no namespace {uri}, but {', '.join(namespaces)}")
        node = f"ns={namespaces.index(uri)};{rest}"
    node_id = ua.NodeId.from_string(node)
    nodeid_to_binary(node_id)  # raises struct.error for a number that is too large
    return node_id
