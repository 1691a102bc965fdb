"""Keys of a line to an OPC UA server."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from compd.documents import AbsolutePath, Positive, Section
from compd.line_settings import PushedLineSettings


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

    period_key: ClassVar[str] = "publishing_s"

    @property
    def address(self) -> str:
        return self.endpoint

    @property
    def longest_period_s(self) -> float:
        """A value waits for the next look at its node, and then for the next message."""
        return self.publishing_s + (self.publishing_s if self.sampling_s is None else self.sampling_s)
