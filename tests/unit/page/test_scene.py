"""What the page draws of a machine: its parts from MACHINE, and no frame where there is none."""

from __future__ import annotations

import pytest
import yaml

from compd.configuration import load
from compd.live.machine import MachineWires
from compd.live.memory import Latest
from compd.live.service.machine_reply import machine_message
from compd.machine_kinds import KINDS, machine_text
from compd.page.scene import scene

SETPOINT = {"valid": True, "tip_M_mm": [0.0, 0.0, 100.0]}
SUPPORTS = [[0.0, 0.0, 0.0]] * 3
BUDGET = {
    "tip_um": {"joints": [0.0] * 3, "frame": [0.0] * 3, "heat": [1.0, 2.0, 3.0]},
    "supports_M_mm": SUPPORTS,
    "supports_moved_um": SUPPORTS,
    "base_joints_M_mm": [[1.0, 2.0, 3.0]] * 6,
    "platform": {"joints_M_mm": [[1.0, 2.0, 50.0]] * 6, "rotation_M_rad": [0.0, 0.0, 0.1]},
}


@pytest.mark.parametrize(
    ("kind", "actuators", "rods", "hinges"),
    [("linear-delta", ["slides"] * 3, 6, 0), ("3-prs", ["slides"] * 3, 3, 3), ("6-rus", ["turns"] * 6, 6, 0)],
)
def test_the_page_is_told_what_moves_each_rod(tmp_path, kind, actuators, rods, hinges):
    path = tmp_path / "mine.yaml"
    path.write_text(machine_text("mine", kind, KINDS[kind].usual))
    configuration = load(path)
    channels = [f"{name}.{c.name}" for name, gauge in configuration.gauge_objects().items() for c in gauge.channels]
    wires = MachineWires(configuration, Latest(channels))
    mechanism = machine_message(configuration, wires)["mechanism"]
    assert [actuator["kind"] for actuator in mechanism["actuators"]] == actuators
    assert (len(mechanism["rods"]), len(mechanism["hinges"])) == (rods, hinges)
    written = yaml.safe_load(path.read_text())["geometry"]["rods"]
    assert [rod["actuator"] for rod in mechanism["rods"]] == [rod["actuator"] for rod in written]


def test_a_machine_without_a_frame_has_none_in_its_picture():
    drawn = scene({"geometry": {}}, SETPOINT, BUDGET)
    assert drawn is not None
    assert drawn["plate"] == drawn["supports"] == drawn["supports_moved_um"] == []
    assert len(drawn["base"]) == 6
    assert drawn["rotation"] == [0.0, 0.0, 0.1]
    assert drawn["tip_moved_um"] == [1.0, 2.0, 3.0]


def test_a_machine_with_a_frame_has_it_in_its_picture():
    drawn = scene({"geometry": {"plate_points_M_mm": SUPPORTS}}, SETPOINT, BUDGET)
    assert drawn is not None
    assert drawn["plate"] == drawn["supports"] == SUPPORTS
