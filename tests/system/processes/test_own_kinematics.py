"""`machine: external` live: a whole daemon, gauges over Modbus TCP and a client; the class is a file with its hash."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from compd.cli.live.watch import view
from compd.client import Client, connect
from compd.errors import DaemonError
from tests.support.external_machines import GANTRY, Served, class_geometry, served
from tests.support.live_models import SPINDLE_GROWTH, file_with
from tests.support.patience import PATIENCE_S
from tests.support.processes import takes_zero
from tests.support.running_daemon import supervised
from tests.support.watching import until

# The gantry is less square than the class says, by so much more of x along y.
SQUARE = {
    "id": "square",
    "physics": "the axes are less square than the class says",
    "port": "reference",
    "sensitivity": "square",
    "parameters": {"square": {"unit": "ppm", "plausible": [-1000, 1000], "source": "a guess"}},
}


def first(messages: Iterator[Any], wanted: Any) -> Any:
    """The first message that is wanted."""
    end_s = time.monotonic() + PATIENCE_S
    for message in messages:
        if wanted(message):
            return message
        assert time.monotonic() < end_s, f"never, still {message}"
    raise AssertionError("no more messages come")


def running(device: Served) -> Any:
    return supervised(device.configuration)


def connected(device: Served) -> Client:
    return connect(device.configuration.sockets.unix.path, PATIENCE_S)


def take_zero(client: Client) -> None:
    """As soon as every gauge is read."""
    until("every gauge is read", lambda: all(gauge["quality"] == "ok" for gauge in client.status()["gauges"]))
    until("machine zero is taken", lambda: takes_zero(client))


def is_ok(setpoint: Any) -> bool:
    return bool(setpoint["state"] == "ok")


@pytest.fixture
def spindle_file(tmp_path: Path) -> Path:
    return file_with(tmp_path / "spindle.yaml", SPINDLE_GROWTH, name="external", links=3, spindle_growth=2.0)


def test_a_class_gives_the_pose_and_a_model_corrects_it(tmp_path: Path, spindle_file: Path) -> None:
    with served(tmp_path, class_geometry(tmp_path)) as device, running(device), connected(device) as client:
        take_zero(client)
        device.values |= {"x": 100.0, "y": -20.0, "z": 30.0}
        there = [100.0, -19.9, 270.0]
        setpoint = first(client.watch(), lambda s: is_ok(s) and s["tip_M_mm"] == pytest.approx(there, abs=1e-4))
        assert setpoint["rotation_M_rad"] == pytest.approx([0, 0, 1e-3], abs=1e-9)
        assert setpoint["tip_correction_mm"] == [0, 0, 0]
        assert first(client.watch(), lambda s: is_ok(s) and "u_tip_um" in s)["u_tip_um"] > 0
        assert not {"link_length_mm", "tip_P_mm"} & setpoint.keys()

        device.values["spindle"] = 30.0
        client.model(str(spindle_file))
        grown = first(client.watch(), lambda s: is_ok(s) and "model" in s and s["tip_correction_mm"][2] > 0.0199)
        assert grown["tip_M_mm"] == pytest.approx([100.0, -19.9, 269.98], abs=1e-4)
        assert grown["tip_correction_mm"] == pytest.approx([0, 0, 0.02], abs=1e-5)
        # z falls as its scale rises: the scale brings the tip back
        assert grown["correction_mm"] == pytest.approx([0, 0, -0.02], abs=1e-5)
        assert client.status()["loop"]["own_kinematics_largest_us"] > 0
        assert client.machine()["geometry"] == {"kinematics": "Gantry", "links": 3}
        assert client.budget()["tip_um"]["spindle_growth"] == pytest.approx([0, 0, -20], abs=0.01)


FAULTY = GANTRY.replace("x, y, z = scale_mm", "x, y, z = scale_mm\n        if x > 50:\n            raise ERROR")


@pytest.mark.parametrize("error", ["RuntimeError('beyond the table')", "SystemExit(3)"])
def test_a_class_that_fails_is_refused_with_its_words_and_the_loop_goes_on(tmp_path: Path, error: str) -> None:
    text = FAULTY.replace("ERROR", error)
    with served(tmp_path, class_geometry(tmp_path, text)) as device, running(device), connected(device) as client:
        take_zero(client)
        setpoints = client.watch()
        before = first(setpoints, is_ok)
        device.values["x"] = 60.0
        refused = first(setpoints, lambda s: s["state"] == "refused")
        assert f"kinematics Gantry.pose: fails: {error.partition('(')[0]}" in refused["reason"]
        assert "tip_M_mm" not in refused
        device.values["x"] = 40.0
        after = first(setpoints, lambda s: is_ok(s) and s["tip_M_mm"][0] == pytest.approx(40.0, abs=1e-4))
        assert after["seq"] > refused["seq"] > before["seq"]
        assert all(process["starts"] == 1 for process in client.status()["processes"].values())


def test_a_client_gives_a_pose_without_scales_and_gets_what_to_add(tmp_path: Path, spindle_file: Path) -> None:
    limits = {"correction_mm": 0.5, "tip_correction_mm": 0.03, "slew_mm_per_s": 100.0, "on_limit": "clamp"}
    with (
        served(tmp_path, {"kinematics": "client"}, limits=limits) as device,
        running(device),
        connected(device) as client,
    ):
        take_zero(client)
        setpoints = client.watch()
        asked = first(setpoints, lambda s: s["state"] == "refused")
        assert "no client has given the pose yet" in asked["reason"]
        device.values["spindle"] = 30.0
        client.model(str(spindle_file))
        client.target([10.0, 20.0, 30.0], [0.0, 0.0, 0.1], id=7)
        answer = first(setpoints, lambda s: is_ok(s) and s["tip_correction_mm"][2] > 0.0199)
        assert (answer["target_id"], answer["mode"]) == (7, "machine_tool")
        assert answer["tip_M_mm"] == answer["tip_B0_mm"] == [10.0, 20.0, 30.0]
        assert answer["rotation_M_rad"] == [0.0, 0.0, 0.1]
        assert answer["rotation_correction_rad"] == [0.0, 0.0, 0.0]
        assert answer["tip_correction_mm"] == pytest.approx([0, 0, 0.02], abs=1e-6)
        assert answer["sources_mm"]["spindle_growth"] == answer["tip_correction_mm"]
        assert not {"scale_setpoint_mm", "correction_mm", "link_length_mm"} & answer.keys()
        device.values["spindle"] = 60.0
        clamped = first(setpoints, lambda s: s["state"] == "clamped" and s["tip_correction_mm"][2] > 0.0299)
        assert clamped["tip_correction_mm"] == pytest.approx([0, 0, 0.03], abs=1e-9)
        assert "tip z: correction 0.080 mm beyond 0.030 mm" in clamped["reason"]


def test_a_client_gives_derivatives_where_there_are_scales(tmp_path: Path) -> None:
    longer = {
        "id": "scale_shift",
        "physics": "a scale was shifted",
        "port": "scale",
        "formula": "k",
        "parameters": {"k": {"unit": "um", "plausible": [-100, 100], "source": "a guess"}},
    }
    model = file_with(tmp_path / "shift.yaml", longer, name="external", links=2, scale_shift=40.0)
    with (
        served(tmp_path, {"kinematics": "client", "links": 2}) as device,
        running(device),
        connected(device) as client,
    ):
        take_zero(client)
        client.model(str(model))
        setpoints = client.watch()
        client.target([1.0, 2.0, 3.0])
        with pytest.raises(DaemonError, match="needs tip_by_scale, 3 or 6 rows of 2 numbers"):
            first(setpoints, is_ok)
        setpoints = client.watch()
        client.target([1.0, 2.0, 3.0], tip_by_scale=[[1.0, 0.0], [0.0, 2.0], [0.0, 0.0]])
        answer = first(setpoints, lambda s: is_ok(s) and s["tip_correction_mm"][0] < -0.0399)
        assert answer["tip_correction_mm"] == pytest.approx([-0.04, -0.08, 0], abs=1e-6)
        assert answer["correction_mm"] == pytest.approx([-0.04, -0.04], abs=1e-6)
        assert "rotation_M_rad" not in answer


def test_a_class_takes_no_target(tmp_path: Path) -> None:
    with served(tmp_path, class_geometry(tmp_path)) as device, running(device), connected(device) as client:
        setpoints = client.watch()
        client.target([0.0, 0.0, 0.0])
        with pytest.raises(DaemonError, match="it takes no target"):
            first(setpoints, lambda s: s["mode"] == "machine_tool")


def test_watch_shows_the_correction_of_the_tip(tmp_path: Path, spindle_file: Path) -> None:
    with served(tmp_path, class_geometry(tmp_path)) as device, running(device), connected(device) as client:
        take_zero(client)
        device.values["spindle"] = 30.0
        client.model(str(spindle_file))
        grown = first(client.watch(), lambda s: is_ok(s) and s["tip_correction_mm"][2] > 0.0199)
        console = Console(width=150, record=True, file=StringIO())
        console.print(view(client.version, grown, client.status(), None))
        text = console.export_text()
    assert re.search(r"tip correction, um +\+0.00 +\+0.00 +\+20.00", text)
    assert re.search(r"spindle_growth, um +\+0.00 +\+0.00 +\+20.00", text)
    assert re.search(r"3 +-20.00", text)


HANGING = GANTRY.replace("x, y, z = scale_mm", "x, y, z = scale_mm\n        while x > 50:\n            pass")


def test_a_class_that_never_returns_stops_the_setpoints_until_the_loop_starts_anew(tmp_path: Path) -> None:
    with served(tmp_path, class_geometry(tmp_path, HANGING)) as device, running(device), connected(device) as client:
        take_zero(client)
        setpoints = client.watch()
        assert first(setpoints, is_ok)
        device.values["x"] = 60.0
        stopped = first(setpoints, lambda s: s["state"] == "stop")
        device.values["x"] = 40.0
        assert "the loop has made no setpoint" in stopped["reason"]
        assert first(setpoints, lambda s: is_ok(s) and s["tip_M_mm"][0] == pytest.approx(40.0, abs=1e-4))
        loop = client.status()["processes"]["loop"]
        assert (loop["starts"], loop["last_end"]) == (2, "it hung, and was killed")
