"""The shipped wiring in LinuxCNC itself, with drives that follow at once, and a daemon that says what the test says."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import pytest

from controller import LinuxCnc, obstacle
from tests.support.setpoint_sender import SetpointSender
from tests.support.simulated import run_directory
from tests.support.watching import until

pytestmark = [pytest.mark.long, pytest.mark.skipif(bool(obstacle()), reason=obstacle())]

# What the daemon asks for with the base of config/hexapod.yaml up by 10 um at machine zero.
UP_10_UM_MM = 0.00914
JOINTS = range(6)


@pytest.fixture(scope="module")
def directory() -> Iterator[Path]:
    with run_directory() as directory:
        yield directory


@pytest.fixture(scope="module")
def sender(directory: Path) -> Iterator[SetpointSender]:
    sender = SetpointSender(directory / "compd.sock")
    yield sender
    sender.close()


@pytest.fixture(scope="module")
def controller(directory: Path, sender: SetpointSender) -> Iterator[LinuxCnc]:
    with LinuxCnc(directory / "controller", directory, hal_files=()) as controller:
        controller.switch_on()
        yield controller


@pytest.fixture
def armed(controller: LinuxCnc, sender: SetpointSender) -> LinuxCnc:
    sender.correction_mm = [0.0] * 6
    controller.wait_for("compd.connected", True)
    controller.with_corrections()
    return controller


def added_mm(controller: LinuxCnc) -> list[float]:
    """What is added to the command of each motor."""
    names = [name for joint in JOINTS for name in (f"joint.{joint}.motor-pos-cmd", f"offset.{joint}.out")]
    values = controller.values(names)
    return [values[f"offset.{joint}.out"] - values[f"joint.{joint}.motor-pos-cmd"] for joint in JOINTS]


def settled_mm(controller: LinuxCnc, mm: float) -> None:
    until(f"{mm} mm are added", lambda: added_mm(controller) == pytest.approx([mm] * 6, abs=1e-7))


@pytest.mark.sample
def test_the_correction_is_added_to_the_command_and_the_controller_sees_no_following_error(
    armed: LinuxCnc, sender: SetpointSender
) -> None:
    sender.correction_mm = [UP_10_UM_MM] * 6
    settled_mm(armed, UP_10_UM_MM)
    values = armed.values([f"joint.{joint}.{name}" for joint in JOINTS for name in ("motor-pos-cmd", "motor-pos-fb")])
    assert list(values.values()) == pytest.approx([0.0] * 12, abs=1e-6)
    assert armed.value("joint.0.pos-cmd") == pytest.approx(547.032723, abs=1e-5)


def test_what_is_beyond_the_limit_or_no_number_is_not_added(armed: LinuxCnc, sender: SetpointSender) -> None:
    sender.correction_mm = [0.05] * 6
    settled_mm(armed, 0.05)
    for wrong, reason in ((5.0, 8), (math.nan, 6), (math.inf, 6)):
        sender.correction_mm = [wrong] * 6
        armed.wait_for("compd.armed", False)
        assert armed.value("compd.reason") == reason
        armed.wait_for("motion.feed-inhibit", True)
        assert added_mm(armed) == pytest.approx([0.05] * 6, abs=1e-7)
        sender.correction_mm = [0.05] * 6
        armed.arm()


def test_without_setpoints_the_feed_is_inhibited_unless_a_person_wants_none(
    armed: LinuxCnc, sender: SetpointSender
) -> None:
    armed.wait_for("motion.feed-inhibit", False)
    sender.correction_mm = None
    armed.wait_for("motion.feed-inhibit", True)
    assert armed.value("compd.reason") == 3
    armed.without_corrections()
    armed.wait_for("motion.feed-inhibit", False)
    armed.set_signal("compd-clear", "1")
    settled_mm(armed, 0.0)
    armed.set_signal("compd-clear", "0")


def test_suspend_holds_what_is_added(armed: LinuxCnc, sender: SetpointSender) -> None:
    sender.correction_mm = [0.02] * 6
    settled_mm(armed, 0.02)
    armed.set_signal("compd-suspend", "1")
    armed.wait_for("compd.suspend", True)
    sender.correction_mm = [0.04] * 6
    armed.wait_for("compd.link.5.asked", 0.04)
    assert added_mm(armed) == pytest.approx([0.02] * 6, abs=1e-7)
    armed.set_signal("compd-suspend", "0")
    settled_mm(armed, 0.04)
