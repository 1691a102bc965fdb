"""The simulated machine's control socket, its sensing through the wiring, and the daemon's configuration."""

from __future__ import annotations

import json
import socket
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
import yaml

from compd.configuration import Configuration, load
from compd.errors import CompdError, ConfigurationError
from compd.simulation.truth.world import World
from compd.simulation.wires.control import MAX_REQUEST, Answer, ControlSocket
from compd.simulation.wires.daemon_configuration import Port, daemon_configuration
from compd.simulation.wires.server import Sensing
from tests.support.patience import PATIENCE_S
from tests.support.simulated import HEXAPOD, TRIPOD, ask, run_directory, section

SHIPPED = pytest.mark.parametrize("path", [TRIPOD, HEXAPOD], ids=["tripod", "hexapod"])


@pytest.fixture
def directory() -> Iterator[Path]:
    with run_directory() as directory:
        yield directory


@pytest.fixture
def client(directory: Path) -> Iterator[socket.socket]:
    def refuse(_: Mapping[str, Any]) -> Answer:
        raise CompdError.of("scale_mm", "beyond the stroke")

    handlers = {
        "ECHO": lambda message: {"class": "ECHO", "value": float(message["value"])},
        "REFUSE": refuse,
    }
    control = ControlSocket(directory / "control.sock", handlers)
    with socket.socket(socket.AF_UNIX) as connection:
        connection.settimeout(PATIENCE_S)
        connection.connect(str(directory / "control.sock"))
        yield connection
    control.stop()
    assert not (directory / "control.sock").exists()


@pytest.mark.parametrize(
    ("request_line", "code"),
    [
        ("{", "not_json"),
        ("[1]", "no_class"),
        ('{"class": 3}', "no_class"),
        ('{"class": "NONE"}', "unknown_class"),
        ('{"class": "ECHO"}', "missing_key"),
        ('{"class": "ECHO", "value": "far"}', "wrong_value"),
        ('{"class": "ECHO", "value": [1]}', "wrong_value"),
        ('{"class": "REFUSE"}', "refused"),
    ],
)
def test_a_bad_request_is_answered_and_harms_nothing(client: socket.socket, request_line: str, code: str) -> None:
    answer = ask(client, request_line)
    assert answer["class"] == "ERROR"
    assert answer["code"] == code
    assert answer["text"]
    assert ask(client, {"class": "ECHO", "value": 2}) == {"class": "ECHO", "value": 2.0}


def test_an_endless_request_is_cut_off(client: socket.socket) -> None:
    client.sendall(b"x" * MAX_REQUEST)
    lines = client.makefile("rb")
    assert json.loads(lines.readline())["code"] == "too_long"
    assert lines.readline() == b""
    lines.close()


def ports(configuration: Configuration, directory: Path) -> dict[str, Port]:
    streams = ("serial", "modbus_rtu")
    return {
        name: str(directory / name) if line.kind in streams else ("127.0.0.1", 40000 + i)
        for i, (name, line) in enumerate(configuration.lines.items())
    }


@SHIPPED
def test_daemon_configuration_differs_only_in_where_things_are(path: Path, directory: Path) -> None:
    original = load(path)
    daemon = daemon_configuration(original, ports(original, directory), directory)
    assert daemon.path == directory / path.name
    assert daemon.zero_hash == original.zero_hash
    assert (daemon.loop, daemon.limits, daemon.gauges) == (original.loop, original.limits, original.gauges)
    moved = {"port", "host"}
    for name, line in original.lines.items():
        assert daemon.lines[name].model_dump(exclude=moved) == line.model_dump(exclude=moved)
        assert daemon.lines[name] != line
    assert daemon.sockets.unix.path == str(directory / "compd.sock")
    assert daemon.state.directory == str(directory / "state")


def test_what_a_simulated_port_does_not_have_is_left_out(directory: Path) -> None:
    """An echo that never comes would make every poll of the simulated line a timeout."""
    copy = directory / "machine.yaml"
    keys = "    echo: true\n    dtr: true\n    rts: false\n    pause_s: 0.01\n"
    copy.write_text(TRIPOD.read_text().replace("    low_latency: true ", f"{keys}    low_latency: true ", 1))
    (directory / "simulated").mkdir()
    original = load(copy)
    line: Any = original.lines["scale_1"]
    assert (line.echo, line.dtr, line.rts, line.pause_s) == (True, True, False, 0.01)
    simulated: Any = daemon_configuration(original, ports(original, directory), directory / "simulated")
    line = simulated.lines["scale_1"]
    assert (line.echo, line.dtr, line.rts, line.pause_s) == (False, None, None, 0.01)


def test_no_setpoint_leaves_this_computer(directory: Path) -> None:
    """The simulated machine's setpoints must never reach the real machine's controller."""
    abroad = {
        "tcp": {"host": "0.0.0.0", "port": 0, "allow": ["10.0.0.0/8"], "token_file": "/etc/compd/token"},
        "udp": {"host": "192.168.10.30", "port": 9000},
    }
    original = load(section_file(directory, abroad))
    daemon = daemon_configuration(original, ports(original, directory), directory)
    assert daemon.sockets.tcp is not None
    assert daemon.sockets.udp is not None
    assert (daemon.sockets.tcp.host, daemon.sockets.udp.host) == ("127.0.0.1", "127.0.0.1")


def test_the_machines_own_configuration_is_never_overwritten(directory: Path) -> None:
    copy = directory / TRIPOD.name
    copy.write_text(TRIPOD.read_text())
    with pytest.raises(ConfigurationError, match="overwrite"):
        daemon_configuration(load(copy), {}, directory)
    assert copy.read_text() == TRIPOD.read_text()


@SHIPPED
def test_every_channel_senses_what_it_is_wired_to(path: Path) -> None:
    configuration = load(path)
    world = World(configuration.geometry, configuration.wiring, seed=1, speedup=100.0)
    for _ in range(50):
        world.advance(0.2)
    sensing = Sensing(configuration, world)
    for gauge, driver in configuration.gauge_objects().items():
        assert all(isinstance(sensing.of(gauge)(channel.name), float) for channel in driver.channels)
    for k, wire in enumerate(configuration.wiring.joint):
        gauge, channel = wire.gauge.split(".")
        assert sensing.of(gauge)(channel) == world.sense(f"joint_{k + 1}")
    for quantity in configuration.wiring.quantities:
        gauge, channel = quantity.gauge.split(".")
        assert sensing.of(gauge)(channel) == world.sense(quantity.name)


def test_signs_and_idle_channels(directory: Path) -> None:
    changed = section(TRIPOD, "wiring")
    changed["scale"][1]["sign"] = -1
    room = changed["quantities"].pop(0)
    configuration = load(whole_file(directory, "wiring", changed))
    world = World(configuration.geometry, configuration.wiring, seed=1, speedup=100.0)
    world.command([3.0, 4.0, 5.0])
    for _ in range(50):
        world.advance(0.1)
    sensing = Sensing(configuration, world)
    shown = [sensing.of(f"scale_{i}")("position") for i in (1, 2, 3)]
    assert shown == pytest.approx([3.0, -4.0, 5.0], abs=1e-4)
    gauge, channel = room["gauge"].split(".")
    assert sensing.of(gauge)(channel) == world.sense("temperature_room_degC")  # wired to nothing, still a room


def section_file(directory: Path, sockets: dict[str, Any]) -> Path:
    return whole_file(directory, "sockets", {**section(TRIPOD, "sockets"), **sockets})


def whole_file(directory: Path, name: str, value: Any) -> Path:
    """The shipped tripod with one section changed, in a place of its own."""
    sections = ("machine", "geometry", "lines", "gauges", "wiring", "loop", "limits", "sockets", "state")
    data = {key: section(TRIPOD, key) for key in sections}
    path = directory / "person" / TRIPOD.name
    path.parent.mkdir(exist_ok=True)
    path.write_text(yaml.safe_dump({**data, name: value}))
    return path
