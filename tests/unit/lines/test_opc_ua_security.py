"""OPC UA with certificates, to a real server: signed and encrypted channels, and who is refused, with what to do."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from cryptography.hazmat.primitives.serialization import BestAvailableEncryption, Encoding, PrivateFormat

from compd.clock import MonotonicClock
from compd.gauge import LineFault, Quality
from compd.lines import open_line
from tests.support.certificates import Certificate, certificate
from tests.support.opc_ua_server import OneUser, OpcUaServer, Security, running_server
from tests.support.patience import PATIENCE_S
from tests.support.wire_rig import SETTINGS


class Plant(NamedTuple):
    """A server that trusts one client, and the certificates of both; of a stranger, and of a client without a URI."""

    server: OpcUaServer
    own: Certificate
    client: Certificate
    stranger: Certificate
    nameless: Certificate


@pytest.fixture(scope="module")
def plant(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Plant]:
    directory = tmp_path_factory.mktemp("certificates")
    names = ("server", "client", "stranger", "nameless")
    own, client, stranger, nameless = (
        certificate(directory, name, uri=None if name == "nameless" else f"urn:compd.example:{name}") for name in names
    )
    with running_server(OneUser(), Security(own, client)) as server:
        server.write("a", 1.5)
        (directory / "secret").write_text("open sesame\n")
        yield Plant(server, own, client, stranger, nameless)


def value(plant: Plant, security: dict[str, Any] | None = None, **keys: Any) -> float:
    """What the node has, read through a line with these keys of `security`."""
    usual = {
        "policy": "Basic256Sha256",
        "certificate": str(plant.client.der),
        "private_key": str(plant.client.key),
        "server_certificate": str(plant.own.der),
    }
    login = {"user": "compd", "password_file": str(plant.own.der.parent / "secret")}
    settings = SETTINGS.validate_python(
        {
            "kind": "opc_ua",
            "endpoint": plant.server.endpoint,
            "timeout_s": PATIENCE_S,
            "security": None if security is None else {**usual, **security},
            **login,
            **keys,
        }
    )
    line: Any = open_line(settings, MonotonicClock())
    try:
        line.subscribe(["ns=2;s=a"])
        message = line.messages()[0]
        assert message.quality is Quality.OK, message.detail
        return float(message.payload)
    finally:
        line.close()


@pytest.mark.parametrize(
    "security", [{}, {"policy": "Aes256Sha256RsaPss", "mode": "Sign"}], ids=["encrypted", "signed"]
)
def test_a_secure_channel_with_user_and_password(plant: Plant, security: dict[str, Any]) -> None:
    assert value(plant, security) == 1.5


def test_certificates_and_keys_are_read_whatever_their_files_are_called(plant: Plant, tmp_path: Path) -> None:
    own, key = tmp_path / "own.crt", tmp_path / "own.key"
    own.write_bytes(plant.client.pem.read_bytes())
    key.write_bytes(plant.client.key.read_bytes())
    assert value(plant, {"certificate": str(own), "private_key": str(key)}) == 1.5


def refusal(plant: Plant, security: dict[str, Any] | None, **keys: Any) -> str:
    with pytest.raises(LineFault) as caught:
        value(plant, security, **keys)
    assert caught.value.quality is Quality.LINE_LOST
    return caught.value.detail


def of(owner: Certificate) -> dict[str, Any]:
    return {"certificate": str(owner.der), "private_key": str(owner.key)}


def test_a_client_that_the_server_does_not_trust_is_refused_with_what_to_do(plant: Plant) -> None:
    assert "BadCertificateUntrusted; let the server trust `certificate`" in refusal(plant, of(plant.stranger))


def test_another_server_is_refused_before_it_hears_a_password(plant: Plant) -> None:
    said = refusal(plant, {"server_certificate": str(plant.stranger.der)})
    assert "its certificate is not `server_certificate`" in said


def test_what_the_server_does_not_offer_is_named_beside_what_it_offers(plant: Plant) -> None:
    said = refusal(plant, {"policy": "Aes128Sha256RsaOaep"})
    assert "does not offer Aes128_Sha256_RsaOaep SignAndEncrypt, but Aes256_Sha256_RsaPss Sign, Basic256Sha256" in said
    assert "write `security`" in refusal(plant, None)


def test_files_that_cannot_be_used_are_named(plant: Plant, tmp_path: Path) -> None:
    assert "is not that of `certificate`" in refusal(plant, {"private_key": str(plant.stranger.key)})
    assert "No such file or directory: '/nowhere'" in refusal(plant, {"certificate": "/nowhere"})
    empty = tmp_path / "empty.der"
    empty.touch()
    for key in ("certificate", "server_certificate", "private_key"):
        assert f"`{key}` {empty} is no" in refusal(plant, {key: str(empty)})
    locked = tmp_path / "locked.pem"
    secret = BestAvailableEncryption(b"secret")
    locked.write_bytes(plant.client.private_key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, secret))
    assert "without a password" in refusal(plant, {"private_key": str(locked)})
    assert "has no URI" in refusal(plant, of(plant.nameless))


def test_a_wrong_password_and_a_missing_user_are_refused(plant: Plant, tmp_path: Path) -> None:
    wrong = tmp_path / "wrong"
    wrong.write_text("close sesame\n")
    for login in ({"password_file": str(wrong)}, {"user": None, "password_file": None}):
        assert "`user` and `password_file`" in refusal(plant, {}, **login)
