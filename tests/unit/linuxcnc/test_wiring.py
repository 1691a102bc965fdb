"""The shipped LinuxCNC machine is the hexapod of config/hexapod.yaml, and corrections have the right sign."""

from __future__ import annotations

import configparser
import re

import numpy as np
import pytest

from compd.simulation import Mechanism
from tests.support.live_machine import machine
from tests.support.paths import CONFIG
from tests.support.simulated import HEXAPOD, hexapod, section

LINUXCNC = CONFIG / "linuxcnc"
UP_MM = 0.010


def ini() -> configparser.ConfigParser:
    parser = configparser.ConfigParser(strict=False)
    parser.read(LINUXCNC / "hexapod.ini")
    return parser


def test_the_joints_of_genhexkins_are_those_of_the_configuration() -> None:
    text = (LINUXCNC / "hexapod_geometry.hal").read_text()
    lines = re.findall(r"^setp genhexkins\.(base|platform)\.(\d)\.([xyz]) (\S+)$", text, re.MULTILINE)
    places = {(body, int(joint), axis): float(value) for body, joint, axis, value in lines}
    assert len(places) == len(lines) == 36
    drawn = Mechanism(hexapod())
    tip_P = np.array(hexapod().tool.at_P_mm)
    for body, joints_mm in (("base", drawn.joints0_M), ("platform", drawn.joints_P - tip_P)):
        written = [[places[body, joint, axis] for axis in "xyz"] for joint in range(6)]
        np.testing.assert_allclose(written, joints_mm, atol=1e-8)


def test_homing_takes_the_lengths_and_the_pose_of_machine_zero() -> None:
    settings, drawn = ini(), Mechanism(hexapod())
    for joint in range(6):
        for key in ("HOME", "HOME_OFFSET"):
            assert float(settings[f"JOINT_{joint}"][key]) == pytest.approx(drawn.lengths0_mm[joint], abs=1e-6)
        assert [float(settings[f"JOINT_{joint}"][key]) for key in ("MIN_LIMIT", "MAX_LIMIT")] == section(
            HEXAPOD, "geometry"
        )["link_length_mm"]
    assert [float(value) for value in settings["TRAJ"]["HOME"].split()[:3]] == drawn.tip0_M.tolist()


def test_the_controller_limits_no_tighter_than_the_daemon() -> None:
    """A correction that the daemon may send must reach the drive: limits of size and speed are at least as large."""
    limits, wiring = section(HEXAPOD, "limits"), ini()["COMPD"]
    assert float(wiring["LIMIT"]) >= limits["correction_mm"]
    assert float(wiring["SLEW"]) >= limits["slew_mm_per_s"]
    assert wiring["SOCKET"] == section(HEXAPOD, "sockets")["unix"]["path"]


def test_links_move_no_faster_than_their_gauges_are_believed() -> None:
    gauges, settings = section(HEXAPOD, "gauges"), ini()
    for joint in range(6):
        believed = gauges[f"scale_{joint + 1}"]["acceleration_mm_per_s2"]
        assert float(settings[f"JOINT_{joint}"]["MAX_ACCELERATION"]) < believed


def test_with_the_base_up_by_10_um_each_command_is_9_14_um_longer_and_the_tip_is_where_it_was() -> None:
    """The sign of what is added to the motor command, against the simulated machine's own kinematics."""
    drawn = Mechanism(hexapod())
    up_mm = np.array([0.0, 0.0, UP_MM])
    live = machine("hexapod.yaml")
    supports_M = drawn.supports0_M
    rods = {"u1": (0, 0), "u2": (0, 2), "u3": (1, 0), "u4": (1, 1), "u5": (2, 1), "u6": (2, 2)}
    wired = section(HEXAPOD, "wiring")["frame"]
    for wire in wired:
        if wire["distance"] in rods:
            support, point = rods[wire["distance"]]
            before_M = supports_M[support] - drawn.plate0_M[point]
            change_mm = np.linalg.norm(before_M + up_mm) - np.linalg.norm(before_M)
            live.change_mm[wire["gauge"]] = float(change_mm)
    values = live.settle().values
    assert values is not None
    np.testing.assert_allclose(values.correction_mm * 1e3, 9.14, atol=0.005)

    raised_M = drawn.joints0_M + up_mm

    def tip_z_mm(correction_mm: np.ndarray) -> float:
        lengths_mm = drawn.lengths0_mm + correction_mm
        posture = drawn.closure.by_lengths(raised_M, drawn.joints_P, lengths_mm, drawn.posture0)
        return float((posture[0] + drawn.tip0_P @ posture[1:])[2])

    assert tip_z_mm(np.zeros(6)) - 320.0 == pytest.approx(UP_MM, abs=1e-6)
    assert tip_z_mm(values.correction_mm) == pytest.approx(320.0, abs=2e-5)
    assert tip_z_mm(-values.correction_mm) - 320.0 == pytest.approx(2 * UP_MM, abs=1e-4)


def test_a_correction_is_limited_before_it_is_added_and_taken_out_before_motion_reads_it() -> None:
    order = re.findall(r"^addf (\S+) servo-thread$", (LINUXCNC / "compd.hal").read_text(), re.MULTILINE)
    places = {function: order.index(function) for function in order}
    assert len(places) == len(order)
    motion = places["motion-controller"]
    for joint in range(6):
        assert places["watchdog.process"] < places[f"limit3.{joint}"]
        assert places[f"limit3.{joint}"] < places[f"offset.{joint}.update-feedback"]
        assert places[f"offset.{joint}.update-feedback"] < places["motion-command-handler"] < motion
        assert motion < places[f"offset.{joint}.update-output"]


def test_each_link_is_wired_to_itself() -> None:
    text = (LINUXCNC / "compd.hal").read_text() + (LINUXCNC / "loopback_drives.hal").read_text()
    for joint in range(6):
        for line in (
            f"net compd-{joint} compd.link.{joint}.offset => limit3.{joint}.in",
            f"net correction-{joint} limit3.{joint}.out => offset.{joint}.offset",
            f"net command-{joint} joint.{joint}.motor-pos-cmd => offset.{joint}.in",
            f"net feedback-{joint} offset.{joint}.fb-out => joint.{joint}.motor-pos-fb",
            f"net drive-{joint} offset.{joint}.out => offset.{joint}.fb-in",
            f"setp limit3.{joint}.min -[COMPD]LIMIT",
            f"setp limit3.{joint}.max [COMPD]LIMIT",
            f"setp limit3.{joint}.maxv [COMPD]SLEW",
        ):
            assert line in text


def test_the_feed_needs_the_watchdog_and_a_bridge_that_is_armed() -> None:
    """The watchdog alone stays content when its enable-in goes FALSE."""
    text = (LINUXCNC / "compd.hal").read_text()
    for line in (
        "net compd-armed compd.armed => watchdog.enable-in compd-good.in0",
        "net compd-watched watchdog.ok-out => compd-good.in1",
        "net compd-ok compd-good.out => compd-not-ok.in",
        "net compd-not-ok compd-not-ok.out => compd-inhibit.in0",
        "net compd-required => compd-inhibit.in1",
        "net compd-inhibit compd-inhibit.out => motion.feed-inhibit",
    ):
        assert line in text
