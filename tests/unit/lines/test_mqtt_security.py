"""MQTT over TLS, to a real broker: who is trusted, who is refused, and what the detail says of it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from cryptography.hazmat.primitives.serialization import BestAvailableEncryption, Encoding, PrivateFormat
from paho.mqtt.client import Client
from paho.mqtt.enums import CallbackAPIVersion

from compd.gauge import LineFault, Quality
from tests.support.certificates import Certificate, certificate
from tests.support.mosquitto import Broker, hashed, needs_mosquitto, running_broker
from tests.unit.lines.test_mqtt import USER, first, line_to

pytestmark = needs_mosquitto


class Plant(NamedTuple):
    """A broker that wants a certificate and a password, its authority, another one, and certificates of both."""

    broker: Broker
    authority: Certificate
    other_authority: Certificate
    client: Certificate
    stranger: Certificate
    secret: Path


@pytest.fixture(scope="module")
def plant(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Plant]:
    directory = tmp_path_factory.mktemp("certificates")
    authority, other = certificate(directory, "authority"), certificate(directory, "other")
    client, stranger = certificate(directory, "client", authority), certificate(directory, "stranger", other)
    own = certificate(directory, "broker", authority)
    passwords, secret = directory / "passwords", directory / "secret"
    passwords.write_text(hashed(*USER))
    passwords.chmod(0o600)
    secret.write_text(f"{USER[1]}\n")
    settings = (
        f"cafile {authority.pem}\ncertfile {own.pem}\nkeyfile {own.key}\nrequire_certificate true\n"
        f"allow_anonymous false\npassword_file {passwords}"
    )
    with running_broker(directory, settings) as broker:
        yield Plant(broker, authority, other, client, stranger, secret)


def keys(plant: Plant, authority: Certificate | None = None, own: Certificate | None = None) -> dict[str, Any]:
    tls = {"ca_file": str((authority or plant.authority).pem)}
    if own is not None:
        tls |= {"certificate": str(own.pem), "private_key": str(own.key)}
    return {"tls": tls, "user": USER[0], "password_file": str(plant.secret)}


def refusal(broker: Broker, **keys: Any) -> str:
    with pytest.raises(LineFault) as caught, line_to(broker, **keys):
        pass
    assert caught.value.quality is Quality.LINE_LOST
    return caught.value.detail


def test_a_broker_that_wants_certificate_user_and_password(plant: Plant) -> None:
    tls = keys(plant, own=plant.client)
    device = Client(CallbackAPIVersion.VERSION2)
    device.tls_set(str(plant.authority.pem), str(plant.client.pem), str(plant.client.key))
    device.username_pw_set(*USER)
    with line_to(plant.broker, ["a"], **tls) as line:
        device.connect("127.0.0.1", plant.broker.port)
        device.publish("a", "1.5")
        device.loop_start()
        assert first(line).payload == b"1.5"
    device.disconnect()
    device.loop_stop()


def test_a_broker_of_another_authority_is_refused(plant: Plant) -> None:
    said = refusal(plant.broker, **keys(plant, plant.other_authority, plant.client))
    assert "the broker's certificate is refused: self-signed certificate in certificate chain; `ca_file`" in said
    of_the_system = {**keys(plant, own=plant.client), "tls": {}}
    assert "certificate is refused" in refusal(plant.broker, **of_the_system), "nobody else vouches for it"


@pytest.mark.parametrize(
    ("made", "reason"),
    [
        ({"host": "127.0.0.2"}, "certificate is not valid for '127.0.0.1'; `host` has to be a name in it"),
        ({"age_days": 31}, "has expired; it, or this computer's clock"),
        ({"age_days": -1}, "is not yet valid; it, or this computer's clock"),
    ],
    ids=["another host", "expired", "not yet valid"],
)
def test_a_certificate_that_is_not_this_brokers_is_refused(
    plant: Plant, tmp_path: Path, made: dict[str, Any], reason: str
) -> None:
    own = certificate(tmp_path, "elsewhere", plant.authority, **made)
    settings = f"certfile {own.pem}\nkeyfile {own.key}\nallow_anonymous true"
    with running_broker(tmp_path, settings) as broker:
        assert reason in refusal(broker, **keys(plant))


def test_a_client_that_the_broker_does_not_trust_is_refused(plant: Plant) -> None:
    for own in (None, plant.stranger):
        assert "does it ask for a `certificate` that it trusts?" in refusal(plant.broker, **keys(plant, own=own))
    without_user = {**keys(plant, own=plant.client), "user": None, "password_file": None}
    assert "refuses: Not authorized" in refusal(plant.broker, **without_user)


def test_tls_on_one_side_alone_is_named(plant: Plant, tmp_path: Path) -> None:
    assert "does it ask for `tls`?" in refusal(plant.broker, **{**keys(plant), "tls": None})
    with running_broker(tmp_path) as plain:
        assert "does this port speak TLS?" in refusal(plain, **keys(plant))


def test_files_that_cannot_be_used_are_named(plant: Plant, tmp_path: Path) -> None:
    tls = keys(plant, own=plant.client)["tls"]
    for ca_file in ("/nowhere", str(plant.secret)):
        assert f"`ca_file` {ca_file} cannot be used" in refusal(plant.broker, tls={**tls, "ca_file": ca_file})
    locked = tmp_path / "locked.pem"
    password = BestAvailableEncryption(b"secret")
    locked.write_bytes(plant.client.private_key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, password))
    for key in (str(plant.stranger.key), str(locked), "/nowhere"):
        assert f"`private_key` {key} cannot be used" in refusal(plant.broker, tls={**tls, "private_key": key})
