"""Base joints that follow the frame: the commanded lengths are the same as with the correction alone."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from compd.simulation import Mechanism
from tests.support.paths import CONFIG
from tests.support.simulated import hexapod
from tests.unit.linuxcnc import conftest  # noqa: F401  puts the bridge's folder on the path

import compd_live_base as live  # isort: skip

LINUXCNC = CONFIG / "linuxcnc"
GEOMETRY = (LINUXCNC / "hexapod_geometry.hal").read_text()
ORIGIN_mm = [0.0, 0.0, 900.0]


def frame(moved_mm: list[float], turned_rad: list[float]) -> list[float]:
    return [*(o + m for o, m in zip(ORIGIN_mm, moved_mm, strict=True)), *moved_mm, *turned_rad]


def test_a_base_that_is_up_by_10_um_makes_all_of_the_correction_and_leaves_no_offset() -> None:
    nominal = live.read_geometry(GEOMETRY)
    shifts_mm = live.base_shifts_mm(nominal, frame([0.0, 0.0, 0.010], [0.0] * 3))
    np.testing.assert_allclose(shifts_mm, [[0.0, 0.0, 0.010]] * 6, atol=1e-12)
    made_mm = live.length_changes_mm(nominal, [0.0, 0.0, 320.0, 0.0, 0.0, 0.0], shifts_mm)
    np.testing.assert_allclose(np.array(made_mm) * 1e3, 9.14, atol=0.005)


@pytest.mark.parametrize("pose", [[0, 0, 320, 0, 0, 0], [40, -30, 340, 5, -3, 7]])
def test_what_genhexkins_makes_of_a_moved_and_turned_base(pose: list[float]) -> None:
    """Against rotations of scipy, with the base truly turned."""
    nominal, drawn = live.read_geometry(GEOMETRY), Mechanism(hexapod())
    moved_mm, turned_rad = [0.012, -0.020, 0.031], [40e-6, -25e-6, 60e-6]
    base_mm = np.array(ORIGIN_mm) + moved_mm + Rotation.from_rotvec(turned_rad).apply(drawn.joints0_M - ORIGIN_mm)
    shifts_mm = np.array(live.base_shifts_mm(nominal, frame(moved_mm, turned_rad)))
    np.testing.assert_allclose(drawn.joints0_M + shifts_mm, base_mm, atol=2e-6)
    attitude = Rotation.from_euler("xyz", pose[3:], degrees=True)
    ends_mm = np.array(pose[:3]) + attitude.apply(drawn.joints_P - np.array(hexapod().tool.at_P_mm))
    before_mm, after_mm = (np.linalg.norm(ends_mm - base, axis=1) for base in (drawn.joints0_M, base_mm))
    np.testing.assert_allclose(
        live.length_changes_mm(nominal, pose, shifts_mm.tolist()), after_mm - before_mm, atol=2e-6
    )


def test_the_hal_file_begins_at_the_nominal_places() -> None:
    nominal = live.read_geometry(GEOMETRY)
    text = (LINUXCNC / "compd_live_base.hal").read_text()
    written = re.findall(r"^setp base-(\d)-([xyz])\.offset (\S+)$", text, re.MULTILINE)
    assert len(written) == 18
    for joint, axis, value in written:
        assert float(value) == nominal.base_mm[int(joint)]["xyz".index(axis)]


def test_a_geometry_that_is_not_complete_is_refused() -> None:
    with pytest.raises(ValueError, match=r"genhexkins\.platform\.5\.z is not set"):
        live.read_geometry(GEOMETRY.replace("setp genhexkins.platform.5.z", "# "))
