"""A real MQTT broker for tests: mosquitto, which can be killed, stopped and started again on the same port."""

from __future__ import annotations

import base64
import hashlib
import shutil
import signal
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from paho.mqtt.client import Client
from paho.mqtt.enums import CallbackAPIVersion

from tests.support.patience import PATIENCE_S
from tests.support.ports import free_port

MOSQUITTO = shutil.which("mosquitto", path="/usr/sbin:/usr/local/sbin:/usr/bin:/usr/local/bin")
needs_mosquitto = pytest.mark.skipif(MOSQUITTO is None, reason="mosquitto is not installed: apt install mosquitto")


class Broker:
    """mosquitto on a port of this computer."""

    def __init__(self, directory: Path, settings: str = "allow_anonymous true") -> None:
        """`settings`: further lines of mosquitto's configuration."""
        self.port = free_port()
        self._file = directory / "mosquitto.conf"
        self._file.write_text(f"listener {self.port} 127.0.0.1\nuser root\n{settings}\n")
        self._process: subprocess.Popen[str] | None = None

    def start(self) -> None:
        """Start it, and wait until it listens."""
        assert MOSQUITTO is not None
        self._process = subprocess.Popen(
            [MOSQUITTO, "-c", str(self._file)], stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True
        )
        assert self._process.stderr is not None
        for line in self._process.stderr:
            if " running" in line:
                # it would stand still if nobody read its log
                self._log = threading.Thread(target=self._process.stderr.read, daemon=True)
                self._log.start()
                return
        raise AssertionError(f"mosquitto does not start, {self._process.wait()}")

    def kill(self) -> None:
        """End it as a crash does."""
        self._end(signal.SIGKILL)

    def stop(self) -> None:
        """End it as a computer that is restarted does: with `persistence` it writes down what it has retained."""
        self._end(signal.SIGTERM)

    def _end(self, how: signal.Signals) -> None:
        if self._process is not None:
            self._process.send_signal(how)
            self._process.wait(PATIENCE_S)
            self._log.join(PATIENCE_S)
            assert self._process.stderr is not None
            self._process.stderr.close()
        self._process = None

    def pause(self) -> None:
        """Let it stand still, its connections open."""
        assert self._process is not None
        self._process.send_signal(signal.SIGSTOP)

    def go_on(self) -> None:
        assert self._process is not None
        self._process.send_signal(signal.SIGCONT)


class Publisher:
    """A device that publishes."""

    def __init__(self, broker: Broker, user: str | None = None, password: str | None = None) -> None:
        self._client = Client(CallbackAPIVersion.VERSION2)
        if user is not None:
            self._client.username_pw_set(user, password)
        self._client.connect("127.0.0.1", broker.port)
        self._client.loop_start()

    def publish(self, topic: str, payload: str | bytes, retain: bool = False) -> None:
        """Publish, and wait until the broker has it."""
        self._client.publish(topic, payload, qos=1, retain=retain).wait_for_publish(PATIENCE_S)

    def close(self) -> None:
        self._client.disconnect()
        self._client.loop_stop()
        self._client.reinitialise()  # closes the two sockets that wake its thread


def hashed(user: str, password: str) -> str:
    """A line of mosquitto's password file, as `mosquitto_passwd` writes it (type 7: PBKDF2 of SHA-512)."""
    salt = bytes(12)
    digest = hashlib.pbkdf2_hmac("sha512", password.encode(), salt, 101)
    return f"{user}:$7$101${base64.b64encode(salt).decode()}${base64.b64encode(digest).decode()}\n"


@contextmanager
def running_broker(directory: Path, settings: str = "allow_anonymous true") -> Iterator[Broker]:
    broker = Broker(directory, settings)
    broker.start()
    try:
        yield broker
    finally:
        broker.kill()


@contextmanager
def publisher(broker: Broker, user: str | None = None, password: str | None = None) -> Iterator[Publisher]:
    device = Publisher(broker, user, password)
    try:
        yield device
    finally:
        device.close()
