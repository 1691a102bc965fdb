"""Base joints of genhexkins that follow the frame, in LinuxCNC itself: the motors get the same commands either way."""

from __future__ import annotations

from contextlib import closing

import pytest

from controller import LinuxCnc, edited, obstacle
from tests.support.setpoint_sender import SetpointSender
from tests.support.simulated import run_directory
from tests.support.watching import until

pytestmark = [pytest.mark.long, pytest.mark.skipif(bool(obstacle()), reason=obstacle())]

UP_MM, LONGER_MM = 0.010, 0.00914


class WithLiveBase(LinuxCnc):
    """As docs/how-to/linuxcnc.md says."""

    def _write_files(self) -> None:
        super()._write_files()
        for name, before, after in (
            ("compd.hal", "[COMPD]BRIDGE --links 6", "[COMPD]BRIDGE --live-base ./hexapod_geometry.hal --links 6"),
            ("machine.ini", "LIMITERS = 6", "LIMITERS = 24"),
            ("machine.ini", "HALFILE = compd.hal\n", "HALFILE = compd.hal\nHALFILE = compd_live_base.hal\n"),
        ):
            path = self.directory / name
            path.write_text(edited(path.read_text(), [(before, after)]))


def drives_mm(controller: LinuxCnc) -> list[float]:
    return list(controller.values([f"offset.{joint}.out" for joint in range(6)]).values())


def test_the_moved_base_makes_what_the_correction_would() -> None:
    with (
        run_directory() as directory,
        closing(SetpointSender(directory / "compd.sock")) as sender,
        WithLiveBase(directory / "controller", directory, hal_files=()) as controller,
    ):
        controller.switch_on()
        assert drives_mm(controller) == pytest.approx([0.0] * 6, abs=1e-6)
        controller.wait_for("compd.connected", True)
        controller.with_corrections()
        sender.frame = {
            "origin_M_mm": [0.0, 0.0, 900.0 + UP_MM],
            "displacement_M_mm": [0.0, 0.0, UP_MM],
            "rotation_M_rad": [0.0] * 3,
        }
        sender.correction_mm = [LONGER_MM] * 6
        until("the drives are there", lambda: drives_mm(controller) == pytest.approx([LONGER_MM] * 6, abs=2e-5))
        raised_mm = pytest.approx(900.0 + UP_MM, abs=1e-6)
        until("the base is there", lambda: controller.value("genhexkins.base.3.z") == raised_mm)
        offsets_mm = controller.values([f"limit3.{joint}.out" for joint in range(6)])
        assert list(offsets_mm.values()) == pytest.approx([0.0] * 6, abs=2e-5)
        assert controller.value("axis.z.pos-cmd") == pytest.approx(320.0, abs=1e-6)
