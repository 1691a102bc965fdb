"""Slips that leave a configuration complete: `compd check` warns of each, with the key, and of nothing else."""

from __future__ import annotations

import copy
import errno
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

from compd.documents import read_document
from compd.machine_check import examine_whole
from tests.support.paths import CONFIG

Data = Any


def swapped(*keys: str, i: int = 1, k: int = 2) -> Callable[[Data], None]:
    """Two entries of a list exchanged."""

    def change(data):
        for key in keys:
            data = data[key]
        data[i], data[k] = data[k], data[i]

    return change


def put(value: object, *keys: str | int) -> Callable[[Data], None]:
    def change(data):
        for key in keys[:-1]:
            data = data[key]
        data[keys[-1]] = value

    return change


def moved(*keys: str, by_mm: tuple[float, float, float], i: int = 0) -> Callable[[Data], None]:
    """A point of the geometry elsewhere."""

    def change(data):
        points = data["geometry"]
        for key in keys:
            points = points[key]
        points[i] = [mm + more for mm, more in zip(points[i], by_mm, strict=True)]

    return change


def itself(data: Any) -> None:
    data["lines"]["cabinet"] |= {"host": "localhost", "port": data["sockets"]["tcp"]["port"]}


def warned(tmp_path: Path, name: str, change: Callable[[Data], None]) -> set[str]:
    """The keys at which the changed configuration has warnings, or problems."""
    data = copy.deepcopy(read_document(CONFIG / name).data)
    change(data)
    path = tmp_path / "machine.yaml"
    path.write_text(yaml.safe_dump(data, sort_keys=False))
    examined = examine_whole(path)
    return {problem.where.partition(" ")[2] for problem in (*examined.problems, *examined.warnings)}


BOTH = ("tripod-cmm.yaml", "hexapod.yaml")
GEOMETRY = {
    "platform joints exchanged": (swapped("geometry", "platform", "joints_P_mm"), "geometry.platform"),
    "plate points exchanged": (swapped("geometry", "plate_points_M_mm"), "geometry.plate_points_M_mm"),
    "supports of joints": (swapped("geometry", "base", "support_of_joint"), "geometry.base.support_of_joint"),
    "signal period": (put(20.0, "geometry", "scale_signal_period_mm"), "geometry.scale_signal_period_mm"),
    "acceleration in m/s2": (put(0.3, "gauges", "scale_1", "acceleration_mm_per_s2"), "gauges.scale_1.acceleration"),
    "port of another system": (put("COM3", "lines", "scale_1", "port"), "lines.scale_1.port"),
    "baud": (put(38401, "lines", "scale_1", "baud"), "lines.scale_1.baud"),
    "a joint far from its support": (moved("base", "joints_B_mm", by_mm=(0, -100, 0)), "geometry.base.joints_B_mm[1]"),
    "a tenth of a coordinate": (moved("base", "joints_B_mm", by_mm=(0, -225, 0)), "geometry.base.joints_B_mm[1]"),
    "a plate point's sign": (moved("plate_points_M_mm", i=1, by_mm=(0, 700, 0)), "geometry.plate_points_M_mm"),
    "degrees": (put([0, 0, 90], "geometry", "base", "rotation_B0_in_M_rad"), "geometry.base.rotation_B0_in_M_rad"),
    "a few degrees": (put([0, 0, 2], "geometry", "base", "rotation_B0_in_M_rad"), "geometry.p"),
    "no serial port": (put("/etc/passwd", "lines", "scale_1", "port"), "lines.scale_1.port"),
    "another scheme": (put("tcp://10.0.0.1:4001", "lines", "scale_1", "port"), "lines.scale_1.port"),
    "a device server's address": (put("socket://192.168.10:4001", "lines", "scale_1", "port"), "lines.scale_1.port"),
    "baud, a digit more": (put(384000, "lines", "joints", "baud"), "lines.joints.baud"),
    "baud, far too fast": (put(1152000, "lines", "joints", "baud"), "lines.joints.baud"),
    "everybody's directory": (put("/tmp", "state", "directory"), "state.directory"),
    "a new directory in everybody's": (put("/tmp/no-such/compd", "state", "directory"), "state.directory"),
    "the system's directory": (put("/etc", "state", "directory"), "state.directory"),
    "a directory that is emptied": (put("/run/compd", "state", "directory"), "state.directory"),
    "the system's for a socket": (put({"path": "/run/compd.sock"}, "sockets", "unix"), "sockets.unix.path"),
    "everybody's socket": (put({"path": "/tmp/compd.sock"}, "sockets", "unix"), "sockets.unix.path"),
}


@pytest.mark.parametrize("name", BOTH)
def test_the_shipped_machines_have_none(tmp_path: Path, name: str) -> None:
    assert warned(tmp_path, name, lambda data: None) == set()


@pytest.mark.parametrize("name", BOTH)
@pytest.mark.parametrize("slip", GEOMETRY)
def test_a_slip_is_found_and_named(tmp_path: Path, name: str, slip: str) -> None:
    change, key = GEOMETRY[slip]
    keys = warned(tmp_path, name, change)
    assert any(warning.startswith(key) for warning in keys), keys


LINES = {
    "a register inside another": (put(1, "gauges", "frame_u", "channels", 1, "address"), "gauges.frame_u.channels[2]"),
    "one register twice": (put(0, "gauges", "frame_u", "channels", 1, "address"), "gauges.frame_u.channels[2]"),
    "wider than its place": (put("float64", "gauges", "frame_u", "channels", 0, "type"), "gauges.frame_u.channels[2]"),
    "the manual's number": (put(30001, "gauges", "frame_u", "channels", 0, "address"), "gauges.frame_u.channels[1]"),
    "a factor of ten thousand": (put(100, "gauges", "cabinet", "channels", 3, "scale"), "gauges.cabinet.channels[4]"),
    "the manual's number, as another": (
        lambda data: data["gauges"]["frame_u"]["channels"][0].update(function=3, address=30001),
        "gauges.frame_u.channels[1]",
    ),
    "whole millimetres": (put("int32", "gauges", "frame_u", "channels", 0, "type"), "gauges.frame_u.channels[1]"),
    "no factor": (put(0, "gauges", "cabinet", "channels", 3, "scale"), "gauges.cabinet.channels[4]"),
    "a falling thermometer": (put(-0.01, "gauges", "cabinet", "channels", 3, "scale"), "gauges.cabinet.channels[4]"),
    "five numbers": (put("192.168.10.20.1", "lines", "cabinet", "host"), "lines.cabinet.host"),
    "a letter in a number": (put("192.168.10.2O", "lines", "cabinet", "host"), "lines.cabinet.host"),
    "commas": (put("192,168,10,20", "lines", "cabinet", "host"), "lines.cabinet.host"),
    "an address of nobody": (put("0.0.0.0", "lines", "cabinet", "host"), "lines.cabinet.host"),
    "a URL": (put("http://192.168.10.20", "lines", "cabinet", "host"), "lines.cabinet.host"),
    "the daemon's own, behind a device server": (put("socket://127.0.0.1:7750", "lines", "joints", "port"), "lines.j"),
    "three numbers of four": (put("192.168.10", "lines", "cabinet", "host"), "lines.cabinet.host"),
    "the daemon's own port": (itself, "lines.cabinet.port"),
}


@pytest.mark.parametrize("slip", LINES)
def test_a_slip_of_a_line_or_a_register_map_is_found_and_named(tmp_path: Path, slip: str) -> None:
    change, key = LINES[slip]
    keys = warned(tmp_path, "tripod-cmm.yaml", change)
    assert any(warning.startswith(key) for warning in keys), keys


@pytest.mark.parametrize(
    "host",
    ["192.168.10.20", "fe80::1", "::1", "::ffff:192.168.10.20", "gateway-3", "1.pool.example.org", "plc_7.local."],
)
def test_an_address_or_a_name_is_none(tmp_path: Path, host: str) -> None:
    assert warned(tmp_path, "tripod-cmm.yaml", put(host, "lines", "cabinet", "host")) == set()


@pytest.mark.parametrize("host", ["255.255.255.255", "224.0.0.1", "ff02::1", "::"])
def test_an_address_of_many_or_of_nobody_is_one(tmp_path: Path, host: str) -> None:
    assert warned(tmp_path, "tripod-cmm.yaml", put(host, "lines", "cabinet", "host")) == {"lines.cabinet.host"}


def test_a_port_that_cannot_be_looked_at_is_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It may be there when the daemon runs, as its own user."""
    look, locked = os.stat, "/run/user/1000/ttyV0"

    def denied(path: Any, *given: Any, **named: Any) -> os.stat_result:
        if str(path) == locked:
            raise PermissionError(errno.EACCES, "Permission denied", path)
        return look(path, *given, **named)

    monkeypatch.setattr("os.stat", denied)
    for port in (locked, "/dev/" + "a" * 300, "/dev/not-there-yet"):
        assert warned(tmp_path, "tripod-cmm.yaml", put(port, "lines", "scale_1", "port")) == set(), port


def test_parts_of_a_register_may_share_it(tmp_path: Path) -> None:
    def change(data):
        low = {
            "name": "a",
            "function": 4,
            "address": 40,
            "type": "uint16",
            "mask": 0xFF,
            "unit": "1",
            "lowest": 0,
            "highest": 255,
        }
        high = {**low, "name": "b", "mask": 0xFF00, "shift": 8}
        data["gauges"]["frame_u"]["channels"] += [low, high]

    assert warned(tmp_path, "tripod-cmm.yaml", change) == set()


def test_exchanged_axes_turn_the_platform(tmp_path: Path) -> None:
    keys = warned(tmp_path, "tripod-cmm.yaml", swapped("geometry", "platform", "revolute_axes_P"))
    axes = {f"geometry.platform.revolute_axes_P[{k}]" for k in (2, 3)}
    assert keys == {"geometry.platform", *axes}


@pytest.mark.parametrize("axis", [[0, 0.392, 0.92], [0, 0, 1], [0, 1, 0]], ids=["along the link", "upright", "radial"])
def test_an_axis_along_its_link_is_named(tmp_path: Path, axis: list[float]) -> None:
    length = sum(part * part for part in axis) ** 0.5
    change = put([part / length for part in axis], "geometry", "platform", "revolute_axes_P", 0)
    assert "geometry.platform.revolute_axes_P[1]" in warned(tmp_path, "tripod-cmm.yaml", change)
