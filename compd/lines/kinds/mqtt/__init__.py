"""Lines to MQTT brokers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from compd.clock import Clock
from compd.lines.kinds.mqtt.settings import MqttLine
from compd.lines.line_definition import Library, PushedDefinition
from compd.lines.port_arguments import PortArguments

if TYPE_CHECKING:
    from compd.lines.kinds.mqtt.subscriber import MqttSubscriber
    from compd.lines.kinds.mqtt.twin import MqttPublisher
    from compd.probes import Computer, Finding


class Mqtt(PushedDefinition):
    """Topics of an MQTT broker, by subscriptions."""

    kind = "mqtt"
    carries = "topics"
    settings = MqttLine
    order = 70
    example_port = "192.168.1.9:1883"
    library = Library("paho", "mqtt")

    def subscriber(self, settings: MqttLine, clock: Clock) -> MqttSubscriber:
        from compd.lines.kinds.mqtt.subscriber import MqttSubscriber

        return MqttSubscriber(settings, clock)

    def simulated_line(self, name: str, devices: Sequence[Any], broker: tuple[str, int] | None) -> MqttPublisher:
        from compd.lines.kinds.mqtt.twin import MqttPublisher

        return MqttPublisher(name, devices, broker)

    def probe(self, computer: Computer, subject: str, settings: MqttLine, daemon_runs: bool) -> Iterator[Finding]:
        from compd.probes import tcp_finding

        yield tcp_finding(subject, settings.host, settings.port, daemon_runs)

    def port_keys(self, port: PortArguments) -> dict[str, Any]:
        return port.network_keys("is no broker", self.example_port)


KIND = Mqtt()
