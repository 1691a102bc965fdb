"""MQTT, by paho-mqtt: what a broker sends of the topics that were subscribed to.

All of it happens in the thread of the line, in `subscribe` and `messages`: no other thread touches it. The session is
clean and the quality of service 0, so that a broker neither keeps values for this client nor sends them twice. A broker
that says nothing for `keep_alive_s` is asked whether it is there (PINGREQ), and is lost if it does not answer.

A message that wakes the thread has arrived just then. One that was there already has arrived at some time since the
socket was seen empty, and that time counts: a thread that cannot keep up has old values, not new ones.

Source: MQTT 3.1.1 (OASIS), chapters 3.1 to 3.3 (CONNECT, CONNACK, PUBLISH), 3.8 and 3.9 (SUBSCRIBE, SUBACK).

TLS to an MQTT broker: the context with the certificates of the configuration, and why a handshake has failed.

The broker's certificate must be vouched for and have the `host` of the line among its names. There is no way round.

Source: OpenSSL, `X509_V_ERR_*` in x509_vfy.h, for the codes of a certificate that is refused.
"""

from __future__ import annotations

import math
import select
import ssl
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from paho.mqtt.client import Client, ConnectFlags, DisconnectFlags, MQTTMessage
from paho.mqtt.enums import CallbackAPIVersion, MQTTErrorCode
from paho.mqtt.properties import Properties
from paho.mqtt.reasoncodes import ReasonCode

from compd.clock import Clock
from compd.gauge import LineFault, Quality
from compd.lines.kinds.mqtt.settings import MqttLine, MqttTls
from compd.pushed_gauge import Message
from compd.source_time import Arrival

_NOT_VOUCHED_FOR = "`ca_file` has to have the certificate that vouches for it"
_OTHER_HOST = "`host` has to be a name in it"
_CLOCK = "it, or this computer's clock, is wrong"
_HINTS: Mapping[int, str] = {
    9: _CLOCK,  # not yet valid
    10: _CLOCK,  # expired
    18: _NOT_VOUCHED_FOR,  # self-signed
    19: _NOT_VOUCHED_FOR,  # self-signed in its chain
    20: _NOT_VOUCHED_FOR,  # no issuer
    62: _OTHER_HOST,  # host name
    64: _OTHER_HOST,  # IP address
}


class _ClosingSocket(ssl.SSLSocket):
    """Closed where the handshake fails: paho leaves it open."""

    def do_handshake(self, block: bool = False) -> None:
        try:
            super().do_handshake(block)
        except OSError:
            self.close()
            raise


def tls_context(settings: MqttTls) -> ssl.SSLContext:
    """The context of a connection. Raises ValueError for files that cannot be used."""
    try:
        context = ssl.create_default_context(cafile=settings.ca_file)
    except OSError as error:
        raise ValueError(f"`ca_file` {settings.ca_file} cannot be used: {error}") from error
    context.sslsocket_class = _ClosingSocket
    if settings.certificate is not None:
        try:
            # without a password, OpenSSL would ask for one on the terminal
            context.load_cert_chain(settings.certificate, settings.private_key, password="")
        except OSError as error:
            files = f"`certificate` {settings.certificate} and `private_key` {settings.private_key}"
            raise ValueError(f"{files} cannot be used, .pem without a password: {error}") from error
    return context


def handshake_failure(error: Exception) -> str:
    """Why there is no connection, and what to do."""
    if isinstance(error, ssl.SSLCertVerificationError):
        hint = _HINTS.get(error.verify_code)
        reason = error.verify_message.rstrip(".")
        return f"the broker's certificate is refused: {reason}{'' if hint is None else f'; {hint}'}"
    if isinstance(error, ssl.SSLError | ConnectionResetError):
        return f"{error}; does this port speak TLS? It is usually 8883"
    return str(error)


# Wait (s) for the network before paho checks the broker's presence.
SLICE_S = 0.1
# Most messages of one call of `messages`; more wait in the socket.
MAX_MESSAGES = 1000
MAX_PASSWORD = 65535  # bytes, MQTT 3.1.1, 3.1.3.5


class MqttSubscriber:
    """A `PushedLine` over MQTT. Used by one thread."""

    last_request_s = -math.inf  # there are no requests
    unexpected_bytes = 0
    request_came_back = False

    def __init__(self, settings: MqttLine, clock: Clock, utc: Callable[[], float] = time.time) -> None:
        """Connect within `settings.timeout_s`. `utc`: the calendar clock, s since 1970.

        Raises LineFault (LINE_LOST) when the broker cannot be reached, or refuses.
        """
        self._where = f"{settings.host}:{settings.port}"
        self._timeout_s = settings.timeout_s
        self._has_tls = settings.tls is not None
        self._clock = clock
        self._utc = utc
        self._came: deque[Message] = deque()
        self._wanted: set[str] = set()
        self._answer: ReasonCode | None = None  # to CONNECT
        self._granted: dict[int, Sequence[ReasonCode]] = {}  # by number of the SUBSCRIBE
        self._why_lost = ""
        self._empty_s = clock.monotonic()  # what is read now has arrived at this time at the earliest
        self._client = Client(CallbackAPIVersion.VERSION2, client_id=settings.client_id or "", clean_session=True)
        self._client.on_connect = self._connected
        self._client.on_disconnect = self._disconnected
        self._client.on_subscribe = self._subscribed
        self._client.on_message = self._received
        self._client.connect_timeout = settings.timeout_s
        try:
            self._log_in(settings)
            self._client.connect(settings.host, settings.port, settings.keep_alive_s)
            self._work_until(lambda: self._answer is not None, "has not accepted the connection")
        except (OSError, ValueError) as error:
            self.close()
            reason = str(error) if settings.tls is None else handshake_failure(error)
            raise LineFault(Quality.LINE_LOST, f"cannot connect to {self._where}: {reason}") from error
        except LineFault:
            self.close()
            raise

    def subscribe(self, addresses: Sequence[str]) -> None:
        """Subscribe to topics, but for those that were subscribed to before.

        One that the broker refuses sends a message with DEVICE_ERROR, and may be asked for again.

        Raises LineFault (LINE_LOST) if the broker does not answer.
        """
        topics = [topic for topic in dict.fromkeys(addresses) if topic not in self._wanted]
        if not topics:
            return
        self._wanted.update(topics)
        error, number = self._client.subscribe([(topic, 0) for topic in topics])
        if error is not MQTTErrorCode.MQTT_ERR_SUCCESS or number is None:
            raise self._lost(error)
        self._work_until(lambda: number in self._granted, "has not confirmed the subscription")
        for topic, code in zip(topics, self._granted.pop(number), strict=False):
            if code.is_failure:
                self._wanted.discard(topic)
                text = f"{self._where} refuses the topic {topic}: {code}"
                self._came.append(Message(topic, b"", self._arrival(), math.nan, Quality.DEVICE_ERROR, text))

    def messages(self, timeout_s: float | None = None) -> Sequence[Message]:
        """See `PushedLine`. The source's time, if there is one, is in the payload. Raises LineFault (LINE_LOST)."""
        deadline_s = self._clock.monotonic() + (self._timeout_s if timeout_s is None else timeout_s)
        while not self._came and self._work(deadline_s):
            pass
        count = len(self._came)
        while count < MAX_MESSAGES:
            self._work(-math.inf)
            if len(self._came) == count:
                break
            count = len(self._came)
        came = list(self._came)
        self._came.clear()
        return came

    def drain(self, quiet_s: float | None = None) -> bytes:
        """Nothing: no message belongs to a request."""
        return b""

    def close(self) -> None:
        """Close the connection."""
        connection = self._client.socket()
        self._client.on_disconnect = None
        self._client.disconnect()
        if connection is not None:
            connection.close()  # paho leaves one open to which DISCONNECT could not be sent

    def _log_in(self, settings: MqttLine) -> None:
        """Raises OSError or ValueError for files that cannot be used."""
        if settings.user is not None:
            password = None
            if settings.password_file is not None:
                password = Path(settings.password_file).read_text(encoding="utf-8").rstrip("\r\n")
                if len(password.encode()) > MAX_PASSWORD:
                    raise ValueError(f"{settings.password_file} is too long for a password")
            self._client.username_pw_set(settings.user, password)
        if settings.tls is not None:
            self._client.tls_set_context(tls_context(settings.tls))

    def _work_until(self, done: Callable[[], bool], what: str) -> None:
        """Raises LineFault (LINE_LOST) if it is not done within the timeout: the broker `what`."""
        deadline_s = self._clock.monotonic() + self._timeout_s
        while not done():
            if not self._work(deadline_s):
                raise LineFault(Quality.LINE_LOST, f"{self._where} {what} within {self._timeout_s:g} s")

    def _work(self, deadline_s: float) -> bool:
        """Send and receive what is there, or comes before the monotonic `deadline_s` (s); whether there is time left.

        Raises LineFault (LINE_LOST).
        """
        left_s = deadline_s - self._clock.monotonic()
        if not self._has_data(0.0):
            self._empty_s = self._clock.monotonic()
            if self._has_data(min(max(left_s, 0.0), SLICE_S)):
                self._empty_s = self._clock.monotonic()
        error = self._client.loop(0.0)
        if error is not MQTTErrorCode.MQTT_ERR_SUCCESS:
            raise self._lost(error)
        return left_s > 0

    def _has_data(self, wait_s: float) -> bool:
        """Whether there is something to read, or comes within `wait_s` (s)."""
        connection = self._client.socket()
        if connection is None:
            return True  # paho says what is wrong
        if isinstance(connection, ssl.SSLSocket) and connection.pending():
            return True
        try:
            return bool(select.select([connection], [], [], wait_s)[0])
        except (OSError, ValueError):
            return True

    def _lost(self, error: MQTTErrorCode) -> LineFault:
        if self._answer is not None and self._answer.is_failure:
            return LineFault(Quality.LINE_LOST, f"{self._where} refuses: {self._answer}")
        if self._answer is None:
            hint = "does it ask for `tls`?" if not self._has_tls else "does it ask for a `certificate` that it trusts?"
            return LineFault(Quality.LINE_LOST, f"{self._where} has closed the connection before the log-in; {hint}")
        reason = self._why_lost or error.name.removeprefix("MQTT_ERR_").replace("_", " ").lower()
        return LineFault(Quality.LINE_LOST, f"{self._where} is gone: {reason}")

    def _arrival(self, kept: bool = False) -> Arrival:
        passed_s = self._clock.monotonic() - self._empty_s
        return Arrival(self._empty_s, self._utc() - passed_s, kept=kept)

    def _connected(
        self, _client: Client, _data: Any, _flags: ConnectFlags, code: ReasonCode, _properties: Properties | None
    ) -> None:
        self._answer = code

    def _disconnected(
        self, _client: Client, _data: Any, _flags: DisconnectFlags, code: ReasonCode, _properties: Properties | None
    ) -> None:
        self._why_lost = str(code)

    def _subscribed(
        self, _client: Client, _data: Any, number: int, codes: list[ReasonCode], _properties: Properties | None
    ) -> None:
        self._granted[number] = codes

    def _received(self, _client: Client, _data: Any, message: MQTTMessage) -> None:
        self._came.append(Message(message.topic, message.payload, self._arrival(message.retain)))
