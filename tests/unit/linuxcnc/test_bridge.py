"""The HAL component with pins that are a dictionary: which setpoints reach which pins."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from tests.support.bridge_daemon import BridgeDaemon
from tests.support.paths import CONFIG
from tests.support.simulated import run_directory
from tests.unit.linuxcnc import conftest  # noqa: F401  puts the bridge's folder on the path

GEOMETRY = (CONFIG / "linuxcnc" / "hexapod_geometry.hal").read_text()
CORRECTION_MM = [0.01, -0.02, 0.03, 0.0, 0.005, -0.2]


class Component(dict[str, Any]):
    """Pins by name, as `hal.component` has them."""

    def newpin(self, name: str, kind: str, _: str) -> None:
        assert name not in self
        self[name] = {"float": 0.0, "bit": False, "u32": 0}[kind]


class Bench:
    """A bridge, its pins and its daemon."""

    def __init__(self, directory: Path, live_base: bool = False) -> None:
        import compd_bridge
        from compd_live_base import read_geometry
        from compd_setpoints import Stream

        self.pins = Component()
        self.daemon = BridgeDaemon(directory / "compd.sock")
        hexapod = read_geometry(GEOMETRY) if live_base else None
        self._stream = Stream(str(directory / "compd.sock"))
        self.bridge = compd_bridge.Bridge(self.pins, self._stream, 6, 0.2, hexapod)
        self.seq = 0
        self.bridge.step()
        self.daemon.greet()
        self.pins["machine-on"] = self.pins["homed"] = True

    def step(self, correction_mm: list[float] = CORRECTION_MM, valid_s: float = 60.0, **keys: Any) -> None:
        """The daemon sends a setpoint, and the bridge reads it."""
        self.seq += 1
        now_s = time.monotonic()
        setpoint = {"class": "SETPOINT", "seq": self.seq, "time_s": now_s, "valid": True, "state": "ok"}
        self.daemon.send_message(
            setpoint | {"valid_until": now_s + valid_s, "correction_mm": correction_mm, "mode": "cmm"} | keys
        )
        self.bridge.step()

    def close(self) -> None:
        self._stream.close()
        self.daemon.close()

    def arm(self) -> None:
        self.pins["arm"] = False
        self.step()
        self.pins["arm"] = True
        self.step()
        assert self.pins["armed"]

    def offsets_mm(self) -> list[float]:
        return [self.pins[f"link.{link}.offset"] for link in range(6)]


@pytest.fixture(autouse=True)
def hal(monkeypatch: pytest.MonkeyPatch) -> None:
    """A `hal` module for the bridge to import."""
    module = ModuleType("hal")
    vars(module).update(
        HAL_FLOAT="float", HAL_BIT="bit", HAL_U32="u32", HAL_IN="in", HAL_OUT="out", component=Component
    )
    monkeypatch.setitem(sys.modules, "hal", module)


@pytest.fixture
def directory() -> Iterator[Path]:
    with run_directory() as directory:
        yield directory


def test_corrections_reach_the_pins_only_when_armed(directory: Path) -> None:
    bench = Bench(directory)
    bench.step()
    assert bench.pins["connected"]
    assert [bench.pins[f"link.{link}.asked"] for link in range(6)] == CORRECTION_MM
    assert bench.offsets_mm() == [0.0] * 6
    bench.arm()
    assert bench.offsets_mm() == CORRECTION_MM
    bench.close()


def test_what_is_refused_leaves_the_pins_as_they_are(directory: Path) -> None:
    bench = Bench(directory)
    bench.arm()
    for message in (
        {"correction_mm": [float("nan")] * 6},
        {"correction_mm": [5.0] * 6},
        {"valid": False, "state": "stop"},
        {"seq": 1},
    ):
        bench.step(**message)
        assert bench.offsets_mm() == CORRECTION_MM
        assert bench.pins["armed"], "the last good one has not expired"
    bench.close()


def test_a_daemon_that_goes_disarms_at_once_and_one_that_comes_back_arms_nothing(directory: Path) -> None:
    bench = Bench(directory)
    bench.arm()
    bench.daemon.connection.close()
    bench.bridge.step()
    assert (bench.pins["armed"], bench.pins["fault"], bench.pins["reason"]) == (False, True, 2)
    assert bench.offsets_mm() == CORRECTION_MM
    heartbeat = bench.pins["heartbeat"]
    bench.bridge.step()
    assert bench.pins["heartbeat"] == heartbeat
    bench.close()


def test_offsets_are_0_while_the_machine_is_not_homed(directory: Path) -> None:
    bench = Bench(directory)
    bench.arm()
    bench.pins["homed"] = False
    bench.step()
    assert bench.offsets_mm() == [0.0] * 6
    assert bench.pins["reason"] == 12
    bench.close()


def test_base_joints_take_the_frames_share_of_the_correction(directory: Path) -> None:
    """The base up by 10 um at machine zero: all of +9.14 um is the frame's, and nothing is left for the offset."""
    bench = Bench(directory, live_base=True)
    bench.pins["pose.z"] = 320.0
    frame = {
        "origin_M_mm": [0.0, 0.0, 900.01],
        "displacement_M_mm": [0.0, 0.0, 0.01],
        "rotation_M_rad": [0.0, 0.0, 0.0],
    }
    bench.pins["arm"] = False
    bench.step([0.00914] * 6, frame=frame)
    bench.pins["arm"] = True
    bench.step([0.00914] * 6, frame=frame)
    assert [bench.pins[f"base.{link}.z"] for link in range(6)] == pytest.approx([0.01] * 6)
    assert bench.offsets_mm() == pytest.approx([0.0] * 6, abs=5e-6)
    bench.pins["homed"] = False
    bench.step([0.00914] * 6, frame=frame)
    assert [bench.pins[f"base.{link}.z"] for link in range(6)] == [0.0] * 6
    bench.close()
