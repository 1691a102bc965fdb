"""Causes in gauges, joints, platform, tool and reference, and those outside the library, against first principles."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from compd.arrays import FloatArray
from compd.simulation.causes.reference import refractivity
from compd.simulation.truth.cause import CauseInputs
from compd.simulation.truth.closure import homogeneous
from compd.simulation.truth.frame import distances_mm
from compd.simulation.truth.weather import REFERENCE_degC
from tests.unit.simulation.test_causes import COSINE, MACHINE, PPM, UM, WARM_K, cause, go, ideal, moved_um, warmed

# --- gauges, joints, platform, tool ---------------------------------------------------------------------------


def test_comparators_that_show_too_much_and_rods_that_grow() -> None:
    assert cause("joint_comparator_gain", 0.2).joint_reading_mm(np.array([4.0])) == pytest.approx([5.0])
    warm = warmed("frame_rod_expansion", 10.0)
    distances = distances_mm(MACHINE.supports0_M, MACHINE.plate0_M)
    shown = [warm.sense(name) for name in warm.names if name.startswith("frame_")]
    assert shown == pytest.approx(-10.0 * PPM * WARM_K * distances, rel=1e-6)
    assert cause("frame_comparator_gain", 0.04).frame_reading_mm(np.full(9, 0.96), None) == pytest.approx([1.0] * 9)
    drifted = warmed("joint_comparator_drift", 0.4)
    assert drifted.sense("joint_5") == pytest.approx(0.4 * UM * WARM_K, rel=1e-6)


def test_a_platform_that_grows_hangs_lower() -> None:
    """Base joints on radius 250, platform joints on 80: what lies between is the links' lean."""
    length, grown = MACHINE.lengths0_mm[0], 80.0 * (1 + 20.0 * PPM * WARM_K)
    lower = np.sqrt(length**2 - (250.0 - grown) ** 2) - np.sqrt(length**2 - (250.0 - 80.0) ** 2)
    assert moved_um(warmed("platform_expansion", 20.0)) == pytest.approx([0, 0, -lower / UM], abs=1e-3)


def test_a_tool_that_grows_or_sits_elsewhere_or_bends() -> None:
    assert moved_um(warmed("tool_expansion", 12.0))[2] == pytest.approx(-60.0 * 12.0 * PPM * WARM_K / UM, rel=1e-6)
    offset = cause("tool_offset", 10.0)
    world = ideal(offset)
    go(world, np.zeros(3))
    assert moved_um(world) == pytest.approx(offset.values, abs=1e-6)
    world = ideal(cause("tool_bending", 0.5))
    world.force_M_N = np.array([8.0, 0.0, -10.0])
    go(world, np.zeros(3))
    assert moved_um(world) == pytest.approx([4.0, 0.0, -4.5], abs=1e-6)


@pytest.mark.parametrize("name", ["base_joint_position", "platform_joint_position", "revolute_axis_tilt"])
def test_parts_that_sit_elsewhere_still_close(name: str) -> None:
    """Links keep their lengths and stay square to their axes: with the parts where they are, not where drawn."""
    askew = cause(name, 80.0)
    world = ideal(askew)
    scale_mm = np.array([30.0, -12.0, 8.0])
    go(world, scale_mm)
    base_M, joints_P, axes_P = MACHINE.joints0_M, MACHINE.joints_P, MACHINE.axes_P
    if name == "base_joint_position":
        base_M = base_M + UM * np.array(askew.values).reshape(3, 3)
    elif name == "platform_joint_position":
        joints_P = joints_P + UM * np.array(askew.values).reshape(3, 3)
    else:
        turned = np.cross([0.0, 0.0, 1.0], axes_P) * 1e-6 * np.array(askew.values)[:, None]
        axes_P = axes_P + turned
    links_M = homogeneous(joints_P) @ world.posture - base_M
    assert np.linalg.norm(links_M, axis=1) == pytest.approx(MACHINE.lengths0_mm + scale_mm, abs=1e-9)
    assert (links_M * (axes_P @ world.posture[1:])).sum(axis=1) == pytest.approx([0.0] * 3, abs=1e-5)
    other = ideal(None)
    go(other, scale_mm)
    assert 1e-4 < np.linalg.norm(world.tip_M_mm() - other.tip_M_mm()) < 1.0


def test_runout_goes_across_the_link_where_no_comparator_looks() -> None:
    world, true = ideal(cause("joint_runout", 20.0)), ideal(None)
    go(world, np.zeros(3))
    assert moved_um(world) == pytest.approx([0.0] * 3, abs=1e-6)
    for machine in (world, true):
        go(machine, np.array([60.0, -30.0, 10.0]))
    assert np.abs(world.link_change_mm() - true.link_change_mm()).max() < 1e-12
    assert all(world.sense(f"joint_{k}") == 0.0 for k in range(1, 10))
    assert 0.1 < np.linalg.norm(world.tip_M_mm() - true.tip_M_mm()) / UM < 60.0


# --- reference --------------------------------------------------------------------------------------------------


def at(tip_M: FloatArray, plate_K: FloatArray | None = None, **more: Any) -> CauseInputs:
    warm = SimpleNamespace(plate_K=plate_K, room_degC=more.pop("room_degC", REFERENCE_degC))
    inputs: Any = SimpleNamespace(tip_M=np.asarray(tip_M), warm=warm, **more)
    return inputs


def test_a_plate_warm_on_top_is_a_cap() -> None:
    """Sagitta of a circle of curvature a dT / h: over the middle a dT R^2 / (2 h) above the plate points."""
    bow = cause("plate_bending", 6.0)
    plate_K = np.linspace(2.0, 0.0, 5)
    risen_um = 6.0 * PPM * 2.0 * 350.0**2 / (2 * 200.0) / UM
    assert bow.reference_shift(at([0.0, 0.0, 190.0], plate_K)) / UM == pytest.approx([0, 0, -risen_um], rel=1e-5)
    assert bow.reference_shift(at([0.0, 350.0, 190.0], plate_K)) / UM == pytest.approx([0, 0, 0], abs=1e-6)
    even = bow.reference_shift(at([0.0, 0.0, 190.0], np.full(5, 2.0)))
    assert even == pytest.approx([0, 0, 0], abs=1e-12)


def test_air_as_edlen_measured_it() -> None:
    """n - 1 = 2.718e-4 in dry standard air at 633 nm and 20 degC; -0.93 ppm/K, +0.27 ppm/hPa, -0.01 ppm/pct."""
    assert refractivity(20.0, 1013.25, 0.0) == pytest.approx(2.7180e-4, abs=1e-7)
    air = refractivity(20.0, 1013.25, 50.0)
    assert refractivity(21.0, 1013.25, 50.0) - air == pytest.approx(-0.95e-6, abs=0.03e-6)
    assert refractivity(20.0, 1014.25, 50.0) - air == pytest.approx(0.268e-6, abs=0.002e-6)
    assert refractivity(20.0, 1013.25, 51.0) - air == pytest.approx(-0.0085e-6, abs=0.001e-6)
    longer = cause("reference_air_index", 1.0).reference_shift(
        at([0.0, 0.0, 200.0], pressure_hPa=1023.25, humidity_pct=50.0)
    )
    assert longer / UM == pytest.approx([0, 0, 200e3 * 2.68e-6], rel=0.02)


def test_a_stand_creeps_and_a_frame_is_laid_over_askew() -> None:
    drift = cause("reference_drift", 2.0)
    assert drift.reference_shift(at([0, 0, 0], time_s=0.0)) == pytest.approx([0, 0, 0])
    hour_um = drift.reference_shift(at([0, 0, 0], time_s=3600.0)) / UM
    assert hour_um == pytest.approx(drift.values, rel=0.02)
    askew = cause("reference_registration", 5.0)
    offset_um, turn_urad = np.array(askew.values).reshape(2, 3)
    place = np.array([50.0, -80.0, 190.0])
    expected_um = offset_um + np.cross(turn_urad, place) * UM
    assert askew.reference_shift(at(place)) / UM == pytest.approx(expected_um, abs=1e-3)


# --- outside the library --------------------------------------------------------------------------------------------


def test_weather_that_the_library_does_not_know() -> None:
    drier = warmed("humidity_swelling", 0.2)
    assert moved_um(drier) == pytest.approx([0, 0, 0.2 * 10.0 / COSINE], rel=1e-4, abs=1e-6)
    lighter = warmed("air_pressure", 0.3)
    assert moved_um(lighter) == pytest.approx([0, 0, -0.3 * 10.0 / COSINE], rel=1e-4, abs=1e-6)
    assert moved_um(warmed("plate_swelling", 0.2)) == pytest.approx([0, 0, 2.0], rel=1e-4, abs=1e-6)


def test_a_blow_lasts_a_cable_pulls_on_one_side_and_a_room_breathes() -> None:
    blow = cause("collision_step", 5.0)
    assert np.all(blow.tool_shift(at([0, 0, 0], time_s=blow.hit_s - 1)) == 0.0)
    assert blow.tool_shift(at([0, 0, 0], time_s=blow.hit_s + 1)) / UM == pytest.approx(blow.values)
    cable = cause("cable_drag", 4.0)
    x = MACHINE.tip0_M[0]
    pulled = [cable.tool_shift(at([x + away, 0.0, 190.0]))[0] / UM for away in (-50.0, 10.0, 60.0, 110.0)]
    assert pulled == pytest.approx([0.0, 0.0, -2.0, -4.0])
    room = cause("room_breathing", 1.0)
    waves = [room.reference_shift(at([0, 0, 0], time_s=time_s))[2] for time_s in (100.0, 100.0 + room.period_s)]
    assert waves[0] == pytest.approx(waves[1], abs=1e-12)
