"""The daemon's configuration for a simulated machine: the machine's own with other ports and sockets."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from compd.configuration import Configuration, load
from compd.documents import read_document
from compd.errors import ConfigurationError
from compd.files import check_replaceable, write_files
from compd.simulation.wires.simulation_directory import DAEMON_SOCKET, STATE, WRITTEN_BY
from compd.simulation.wires.tcp_port import ANY, LOOPBACK

# Keys of a line without meaning for a simulated one: a pty lacks them, and it needs no login.
NOT_SIMULATED = ("dtr", "rts", "rs485", "echo", "security", "tls", "user", "password_file", "client_id")
# Temperature difference (K) of parts that a plan may hold.
_HELD_APART_K = 60.0
Port = str | tuple[str, int]


def daemon_path(configuration: Configuration, directory: Path) -> Path:
    """Path of the daemon's configuration in `directory`. ConfigurationError if that is the machine's own file."""
    path = directory / configuration.path.name
    if path.resolve() == configuration.path.resolve():
        raise ConfigurationError.of(
            "--directory",
            "would overwrite the machine's own configuration",
            value=str(path),
            next_step="choose another directory",
        )
    return path


def daemon_configuration(
    configuration: Configuration,
    ports: Mapping[str, Port],
    directory: Path,
    tcp_port: int = ANY,
    fastest_K_per_s: float = 0.0,
) -> Configuration:
    """Write and load a copy of the configuration, under the same file name in `directory`, with these ports.

    ports : by line, a device path or (host, port). tcp_port : where the daemon listens, if it does over TCP.
    fastest_K_per_s : of the simulated parts, where they warm up faster than real ones; 0 where they do not.

    Unix socket and state directory are in `directory`. TCP and UDP are bound to this computer, so that no real
    controller receives setpoints for a machine that does not exist.
    """
    path = daemon_path(configuration, directory)
    data = read_document(configuration.path).data
    for name, port in ports.items():
        line = data["lines"][name]
        for key in NOT_SIMULATED:
            line.pop(key, None)
        if isinstance(port, str):
            line["endpoint" if "endpoint" in line else "port"] = port
        else:
            line["host"], line["port"] = port
    sockets = data["sockets"]
    sockets["unix"] = {"path": str(directory / DAEMON_SOCKET)}
    if configuration.sockets.tcp is not None:
        sockets["tcp"] = {"host": LOOPBACK, "port": tcp_port}
    if configuration.sockets.udp is not None:
        sockets["udp"] = {"host": LOOPBACK, "port": configuration.sockets.udp.port}
    if fastest_K_per_s:
        for wire in data["wiring"].get("quantities") or ():
            if wire["name"].endswith("_degC"):
                wire |= {"fastest_change": fastest_K_per_s, "apart": _HELD_APART_K}
    data["state"] = {"directory": str(directory / STATE)}
    (directory / STATE).mkdir(exist_ok=True)
    _write(path, configuration.path, data)
    return load(path)


def _write(path: Path, original: Path, data: dict[str, Any]) -> None:
    head = f"# {original.name} {WRITTEN_BY} run`, gone with it.\n"
    check_replaceable(path, (WRITTEN_BY.encode(),), "a configuration of a simulated machine")
    # whole at once: a daemon may be waiting for it
    write_files({path: head + yaml.safe_dump(data, sort_keys=False, width=110)})
