"""The simulated machine's gauges as publishers on the topics of an MQTT broker, which a person names."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from paho.mqtt.client import Client
from paho.mqtt.enums import CallbackAPIVersion

from compd.errors import CompdError
from compd.twins import WRONG_TYPE, SimulatedPushedDevice, SimulatedPushedLine

NOT_A_NUMBER = "not a number"
# Text of spreadsheets and gateways for a missing value.
NO_VALUE = b"#N/A"


class MqttPublisher(SimulatedPushedLine):
    """Publishes to a broker other than that of the machine's own configuration, where real programs may listen."""

    kind = "mqtt"
    own_faults = (NOT_A_NUMBER,)

    def __init__(self, name: str, devices: Sequence[SimulatedPushedDevice], broker: tuple[str, int] | None) -> None:
        """`broker`: host and port. Raises CompdError if there is none."""
        super().__init__(name, devices)
        if broker is None:
            raise CompdError.of(
                f"lines.{name}",
                "the simulated machine does not publish to the real machine's broker",
                next_step="start one, for instance `mosquitto -p 1884`, and name it: --broker 127.0.0.1:1884",
            )
        self._broker = broker
        self._client: Client

    @property
    def port(self) -> tuple[str, int]:
        return self._broker

    def plug_in(self) -> None:
        self._client = Client(CallbackAPIVersion.VERSION2)
        try:
            self._client.connect(*self._broker)
        except OSError as error:
            where = f"--broker {self._broker[0]}:{self._broker[1]}"
            raise CompdError.of(
                where, f"no MQTT broker answers: {error}", next_step="start it, or name another"
            ) from error
        self._client.loop_start()  # which connects again by itself

    def pull_out(self) -> None:
        self._client.disconnect()
        self._client.loop_stop()
        self._client.reinitialise()  # closes the two sockets that wake its thread

    def send(self, values: Mapping[str, Any], utc_s: float, fault: str | None = None) -> None:
        for topic, payload in values.items():
            self._client.publish(topic, _damaged(payload, fault))


def _damaged(payload: bytes, fault: str | None) -> bytes:
    """The payload as a source with this fault publishes it."""
    if fault == NOT_A_NUMBER:
        return NO_VALUE
    if fault == WRONG_TYPE:
        return json.dumps(_numbers_as_text(json.loads(payload))).encode()
    return payload


def _numbers_as_text(document: Any) -> Any:
    """The JSON document with text in place of each number."""
    if isinstance(document, dict):
        return {key: _numbers_as_text(value) for key, value in document.items()}
    if isinstance(document, list):
        return [_numbers_as_text(value) for value in document]
    return str(document) if isinstance(document, int | float) and not isinstance(document, bool) else document
