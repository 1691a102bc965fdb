"""Three links with kinematics of one's own, here LinuxCNC's straight axes: wired as docs/how-to/linuxcnc.md says."""

from __future__ import annotations

import re
from contextlib import closing

import pytest

from controller import LinuxCnc, edited, obstacle
from tests.support.setpoint_sender import SetpointSender
from tests.support.simulated import run_directory
from tests.support.watching import until

pytestmark = [pytest.mark.long, pytest.mark.skipif(bool(obstacle()), reason=obstacle())]

ASKED_MM = [0.010, -0.020, 0.030]
# A line that names link or joint 3, 4 or 5.
OTHER_LINKS = re.compile(r"^.*[.-][345](?=[. ]|$).*\n", re.MULTILINE)


class WithThreeLinks(LinuxCnc):
    def _write_files(self) -> None:
        super()._write_files()
        wiring = self.directory / "compd.hal"
        text = OTHER_LINKS.sub("", wiring.read_text())
        wiring.write_text(edited(text, (("--links 6", "--links 3"), ("offset count=6", "offset count=3"))))
        drives = self.directory / "loopback_drives.hal"
        drives.write_text(OTHER_LINKS.sub("", drives.read_text()))
        machine = self.directory / "machine.ini"
        text = machine.read_text()
        text = re.sub(r"\[(JOINT_[345]|AXIS_[ABC])\]\n(.+\n)*", "", text)
        text = re.sub(r"^(HOME|HOME_OFFSET) = 547\.\d+$", r"\1 = 0", text, flags=re.MULTILINE)
        text = re.sub(r"^MIN_LIMIT = \d+$", "MIN_LIMIT = -100", text, flags=re.MULTILINE)
        changes = (
            ("LIMITERS = 6", "LIMITERS = 3"),
            ("KINEMATICS = genhexkins\nJOINTS = 6", "KINEMATICS = trivkins coordinates=XYZ\nJOINTS = 3"),
            ("COORDINATES = X Y Z A B C", "COORDINATES = X Y Z"),
            ("HOME = 0 0 320 0 0 0", "HOME = 0 0 0"),
            ("GEOMETRY = XYZABC", "GEOMETRY = XYZ"),
            ("HALFILE = hexapod_geometry.hal\n", ""),
        )
        machine.write_text(edited(text, changes))


def test_corrections_of_three_links_reach_three_drives() -> None:
    with run_directory() as directory, closing(SetpointSender(directory / "compd.sock")) as sender:
        sender.correction_mm = [0.0] * 3
        with WithThreeLinks(directory / "controller", directory, hal_files=()) as controller:
            controller.switch_on()
            controller.wait_for("compd.connected", True)
            controller.set_signal("compd-required", "1")
            controller.arm()
            sender.correction_mm = ASKED_MM

            def drives_mm() -> list[float]:
                return list(controller.values([f"offset.{joint}.out" for joint in range(3)]).values())

            until("the drives are there", lambda: drives_mm() == pytest.approx(ASKED_MM, abs=1e-6))
            assert controller.value("axis.z.pos-cmd") == pytest.approx(0.0, abs=1e-6)
            sender.correction_mm = [0.0] * 6
            controller.wait_for("compd.armed", False)
            assert controller.value("compd.reason") == 7
            controller.wait_for("motion.feed-inhibit", True)
