"""Keys of a line to an MQTT broker."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from compd.documents import AbsolutePath, Section, Text, refusal
from compd.line_settings import NetworkPort, PushedLineSettings


class MqttTls(Section):
    """TLS to an MQTT broker."""

    ca_file: AbsolutePath | None = Field(
        default=None, description="certificates that vouch for the broker, .pem; those of the system if left out"
    )
    certificate: AbsolutePath | None = Field(default=None, description="compd's own, .pem, where the broker asks")
    private_key: AbsolutePath | None = Field(default=None, description="of compd's own certificate, .pem")

    @model_validator(mode="after")
    def _key_of_a_certificate(self) -> Self:
        if (self.certificate is None) != (self.private_key is None):
            raise refusal("`certificate` and `private_key` belong together", "both, or none")
        return self


class MqttLine(PushedLineSettings):
    """An MQTT broker (3.1.1), by subscriptions of quality of service 0."""

    kind: Literal["mqtt"] = Field(description="topics of an MQTT broker")
    host: Text = Field(description="name or address of the broker")
    port: NetworkPort = Field(default=1883, description="TCP port; with TLS usually 8883")
    client_id: Text | None = Field(default=None, description="as the broker's rules know it; one by chance if left out")
    keep_alive_s: Annotated[int, Field(ge=1, le=3600)] = Field(
        default=5, description="a broker that says nothing for twice as long is lost"
    )
    tls: MqttTls | None = Field(default=None, description="left out: no TLS; `tls: {}` with the system's certificates")
