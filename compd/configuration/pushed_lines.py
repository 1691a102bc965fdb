"""Lines with pushed values: OPC UA and MQTT."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from compd.configuration.section import AbsolutePath, Positive, Section, Text, refusal


class PushedLineSettings(Section):
    """Common keys of these lines."""

    # Devices that push their values cannot be told to latch.
    round_trigger: ClassVar[None] = None

    timeout_s: Positive = Field(description="how long the other end may take to accept a connection, or to answer")
    back_off_s: tuple[Positive, Positive] = Field(
        default=(0.5, 10.0), description="wait after a lost line: first and longest, doubling between"
    )
    user: Text | None = Field(default=None, description="name for the login; omitted for none")
    password_file: AbsolutePath | None = Field(default=None, description="file with the password of `user`, one line")

    @model_validator(mode="after")
    def _password_of_a_user(self) -> Self:
        if self.password_file is not None and self.user is None:
            raise refusal("`password_file` without a `user`", "both, or none", "write `user:`")
        return self


class OpcUaSecurity(Section):
    """A signed, or signed and encrypted, channel to an OPC UA server."""

    policy: Literal["Basic256Sha256", "Aes128Sha256RsaOaep", "Aes256Sha256RsaPss"] = Field(
        description="as one of the server's endpoints offers it"
    )
    mode: Literal["Sign", "SignAndEncrypt"] = Field(default="SignAndEncrypt", description="what happens to a message")
    certificate: AbsolutePath = Field(description="compd's own, .der or .pem; the server must trust it")
    private_key: AbsolutePath = Field(description="of compd's own certificate, .pem")
    server_certificate: AbsolutePath = Field(description="the server's, .der or .pem: another server is refused")


class OpcUaLine(PushedLineSettings):
    """An OPC UA server, by a subscription."""

    kind: Literal["opc_ua"] = Field(description="nodes of an OPC UA server")
    endpoint: Annotated[str, Field(pattern=r"^opc\.tcp://[^\s/:]+:\d+(/\S*)?$")] = Field(
        description="of the server, opc.tcp://host:port/path"
    )
    publishing_s: Positive = Field(default=0.05, description="how often the server is to send what is new")
    sampling_s: Positive | None = Field(
        default=None, description="how often the server is to look at a node; `publishing_s` if left out"
    )
    unchanged: Literal["stale", "holds"] = Field(
        default="stale",
        description="a value that the server sends no more. stale: its source may have stopped, only a new time of the "
        "source makes it new; holds: this server is silent while a value stands still, and its keep-alive confirms it",
    )
    security: OpcUaSecurity | None = Field(default=None, description="left out: neither signed nor encrypted")


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
    port: Annotated[int, Field(ge=1, le=65535)] = Field(default=1883, description="TCP port; with TLS usually 8883")
    client_id: Text | None = Field(default=None, description="as the broker's rules know it; one by chance if left out")
    keep_alive_s: Annotated[int, Field(ge=1, le=3600)] = Field(
        default=5, description="a broker that says nothing for twice as long is lost"
    )
    tls: MqttTls | None = Field(default=None, description="left out: no TLS; `tls: {}` with the system's certificates")
