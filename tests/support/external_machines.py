"""`machine: external` over Modbus TCP: a gantry whose class is in a file, or whose pose a client gives."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import yaml

from compd.configuration import Configuration
from compd.machine_check import load_whole
from tests.support.wire_rig import rig

GANTRY = '''\
"""A gantry whose y axis is not square, and leans with x."""

import compd


class Gantry(compd.Kinematics):
    gives = ("d_square_y_mm",)

    def pose(self, scale_mm, settings):
        x, y, z = scale_mm
        return [x, y + 1e-3 * x, 300.0 - z, 0.0, 0.0, 1e-5 * x]

    def columns(self, scale_mm, settings):
        return {"d_square_y_mm": scale_mm[0]}
'''
SCALES = ("x", "y", "z")
RATE_HZ = 50


def gantry_file(folder: Path, text: str = GANTRY) -> tuple[Path, str]:
    """The file of the class, and its hash."""
    file = folder / "gantry.py"
    file.write_text(text)
    return file, hashlib.sha256(file.read_bytes()).hexdigest()


def class_geometry(folder: Path, text: str = GANTRY, **changed: Any) -> dict[str, Any]:
    file, sha256 = gantry_file(folder, text)
    return {"kinematics": f"{file}:Gantry", "sha256": sha256, "links": 3, **changed}


def external_yaml(folder: Path, geometry: dict[str, Any], **changed: Any) -> Path:
    """A configuration with as many scales as the geometry has links, and a thermometer."""
    scales = SCALES[: geometry.get("links", 0)]
    channels = [
        {"name": name, "function": 4, "address": 2 * k, "type": "float32", "unit": "mm"}
        for k, name in enumerate(scales)
    ]
    channels.append({"name": "spindle", "function": 4, "address": 10, "type": "float32", "unit": "degC"})
    data: dict[str, Any] = {
        "machine": "external",
        "geometry": geometry,
        "lines": {"plc": {"kind": "modbus_tcp", "host": "127.0.0.1", "port": 502, "timeout_s": 1.0}},
        "gauges": {
            "plc": {
                "driver": "modbus",
                "line": "plc",
                "unit": 1,
                "noise_um": 0.05,
                "acceleration_mm_per_s2": 1e15,
                "trust_after_loss": True,
                "channels": channels,
            }
        },
        "wiring": {
            "scale": [{"link": k, "gauge": f"plc.{name}"} for k, name in enumerate(scales, start=1)],
            "quantities": [
                {"name": "temperature_spindle_degC", "gauge": "plc.spindle", "noise": 0.01, "fastest_change": 1000000}
            ],
            "frame_drift_um": 0,
        },
        "loop": {"rate_hz": RATE_HZ, "stale_after_s": 5.0, "on_stale": "stop", "hold_s": 1.0, "lock_memory": False},
        "limits": {"correction_mm": 0.5, "slew_mm_per_s": 100.0, "on_limit": "clamp"},
        "sockets": {"unix": {"path": str(folder / "s")}, "valid_for_s": 0.1},
        "state": {"directory": str(folder / "state")},
    }
    path = folder / "external.yaml"
    path.write_text(yaml.safe_dump({**data, **changed}, sort_keys=False))
    return path


@dataclass
class Served:
    """A configuration whose gauges answer on a port of this computer, and show `values` by channel."""

    configuration: Configuration
    values: dict[str, float]


@contextmanager
def served(folder: Path, geometry: dict[str, Any], **changed: Any) -> Iterator[Served]:
    loaded = load_whole(external_yaml(folder, geometry, **changed))
    gauge = loaded.gauges["plc"].model_dump(mode="json", exclude_unset=True)
    values = {**dict.fromkeys(SCALES, 0.0), "spindle": 20.0}
    with rig(folder, loaded.lines["plc"].model_dump(mode="json"), {"plc": gauge}, values) as device:
        yield Served(replace(loaded, lines={"plc": device.settings}), values)
