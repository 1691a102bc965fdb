"""The MQTT line with a real broker: what comes, when, and a broker that refuses, dies or stands still."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest

from compd.clock import MonotonicClock
from compd.gauge import LineFault, Quality
from compd.lines import open_line
from compd.lines.kinds.mqtt.subscriber import MqttSubscriber
from compd.pushed_gauge import Message
from tests.support.hand_clock import HandClock
from tests.support.mosquitto import Broker, hashed, needs_mosquitto, publisher, running_broker
from tests.support.patience import PATIENCE_S
from tests.support.wire_rig import SETTINGS

OK = Quality.OK
pytestmark = needs_mosquitto
UTC_S = 1.8e9  # of monotonic 0
USER = ("compd", "open sesame")


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Broker]:
    with running_broker(tmp_path) as started:
        yield started


def settings_to(broker: Broker | int, **keys: Any) -> Any:
    port = broker.port if isinstance(broker, Broker) else broker
    return SETTINGS.validate_python(
        {"kind": "mqtt", "host": "127.0.0.1", "port": port, "timeout_s": PATIENCE_S, **keys}
    )


@contextmanager
def line_to(broker: Broker | int, topics: list[str] | None = None, **keys: Any) -> Iterator[Any]:
    line: Any = open_line(settings_to(broker, **keys), MonotonicClock())
    try:
        line.subscribe(topics or [])
        yield line
    finally:
        line.close()


def first(line: Any) -> Message:
    messages = line.messages()
    assert messages, "nothing came"
    return messages[0]  # type: ignore[no-any-return]


def test_a_message_has_topic_payload_and_the_times_of_its_arrival(broker: Broker) -> None:
    clock = MonotonicClock()
    opened_s = clock.monotonic()
    with line_to(broker, ["a/b"]) as line, publisher(broker) as device:
        device.publish("a/other", "0")
        device.publish("a/b", "1.25")
        message = first(line)
        assert (message.address, message.payload, message.quality) == ("a/b", b"1.25", OK)
        assert opened_s < message.arrival.arrived_s <= clock.monotonic()
        assert not message.arrival.kept
        assert line.messages(0.0) == []


def test_messages_come_in_their_order(broker: Broker) -> None:
    with line_to(broker, ["a"]) as line, publisher(broker) as device:
        for number in range(50):
            device.publish("a", str(number))
        came: list[bytes] = []
        while len(came) < 50:
            came += [message.payload for message in line.messages()]
        assert came == [str(number).encode() for number in range(50)]


def test_what_the_broker_kept_is_marked(broker: Broker) -> None:
    with publisher(broker) as device:
        device.publish("a", "1", retain=True)
        with line_to(broker, ["a"]) as line:
            assert first(line).arrival.kept
            device.publish("a", "2", retain=True)
            assert not first(line).arrival.kept, "to one who is there already it is new"


def test_a_dead_broker_is_a_lost_line(broker: Broker) -> None:
    with line_to(broker, ["a"]) as line:
        broker.kill()
        with pytest.raises(LineFault, match="is gone") as caught:
            line.messages()
        assert caught.value.quality is Quality.LINE_LOST


def test_a_broker_that_stands_still_is_lost_though_its_connection_is_open(broker: Broker) -> None:
    with line_to(broker, ["a"], keep_alive_s=1) as line:
        broker.pause()
        with pytest.raises(LineFault, match="Keep alive timeout") as caught:
            line.messages()
        assert caught.value.quality is Quality.LINE_LOST
        broker.go_on()


def test_no_broker_is_a_lost_line_with_its_address() -> None:
    with socket.socket() as nobody:
        nobody.bind(("127.0.0.1", 0))  # bound, and not listening
        settings = SETTINGS.validate_python(
            {"kind": "mqtt", "host": "127.0.0.1", "port": nobody.getsockname()[1], "timeout_s": PATIENCE_S}
        )
        with pytest.raises(LineFault, match=r"cannot connect to 127.0.0.1:\d+: .*refused") as caught:
            open_line(settings, MonotonicClock())
        assert caught.value.quality is Quality.LINE_LOST


def test_one_that_is_no_broker_is_a_lost_line() -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        settings = SETTINGS.validate_python(
            {"kind": "mqtt", "host": "127.0.0.1", "port": silent.getsockname()[1], "timeout_s": 0.1}
        )
        with pytest.raises(LineFault, match=r"has not accepted the connection within 0.1 s"):
            open_line(settings, MonotonicClock())


def test_a_topic_that_the_broker_refuses_has_no_value_and_the_others_go_on() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            """CONNACK, then a SUBACK that grants the second of two topics, and a PUBLISH on it."""
            connection, _ = server.accept()
            with connection:
                connection.recv(1024)
                connection.sendall(bytes.fromhex("20 02 00 00"))
                number = connection.recv(1024)[2:4]
                connection.sendall(b"\x90\x04" + number + b"\x80\x00" + b"\x30\x04\x00\x01b7")
                connection.recv(1024)  # until the line closes

        with ThreadPoolExecutor(1) as pool:
            served = pool.submit(serve)
            with line_to(server.getsockname()[1], ["a", "b"]) as line:
                came: list[Message] = []
                while len(came) < 2:
                    came += line.messages()
            served.result(PATIENCE_S)
    assert {message.address: message.quality for message in came} == {"a": Quality.DEVICE_ERROR, "b": OK}
    assert any("refuses the topic a" in message.detail for message in came)


def test_what_has_waited_in_the_socket_has_the_time_since_which_it_may_have_waited(broker: Broker) -> None:
    clock = HandClock()
    line = MqttSubscriber(settings_to(broker), clock, lambda: clock.now_s + UTC_S)
    with closing(line), publisher(broker) as device:
        line.subscribe(["a"])
        device.publish("a", "1")
        first(line)
        seen_empty_s = clock.now_s
        clock.now_s += 5.0  # the thread does something else meanwhile
        device.publish("a", "2")
        assert line._has_data(PATIENCE_S)
        arrival = first(line).arrival
        assert (arrival.arrived_s, arrival.arrived_utc_s) == (seen_empty_s, seen_empty_s + UTC_S), "one moment"


def test_user_and_password_out_of_a_file(tmp_path: Path) -> None:
    passwords, rules, secret = tmp_path / "passwords", tmp_path / "rules", tmp_path / "secret"
    passwords.write_text(hashed(*USER))
    rules.write_text("user compd\ntopic readwrite allowed/#\n")
    for file in (passwords, rules):
        file.chmod(0o600)
    secret.write_text("open sesame\n")
    settings = f"allow_anonymous false\npassword_file {passwords}\nacl_file {rules}"
    with running_broker(tmp_path, settings) as broker:
        with pytest.raises(LineFault, match=r"(?i)not authori[sz]ed") as caught, line_to(broker):
            pass
        assert caught.value.quality is Quality.LINE_LOST
        login = {"user": "compd", "password_file": str(secret)}
        with line_to(broker, ["allowed/a"], **login) as line, publisher(broker, *USER) as device:
            device.publish("allowed/a", "1")
            assert first(line).payload == b"1"
        with pytest.raises(LineFault, match="No such file"), line_to(broker, user="compd", password_file="/nowhere"):
            pass
