"""Each effect against its physics by hand: closed forms, another solver, another way to think of it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from compd.model import Deltas, effect_deltas, predict
from compd.model.effects import FittedEffect
from compd.model.kinematics import Movement
from tests.support.effect_rows import HEXAPOD, LIBRARY, TRIPOD, delta_mm, row_at_zero, rows_at_tips, solve_tip
from tests.support.model_machines import Floats, tips

UM = 1e-3
LINK_MM = 481.040538832228  # the tripod's links at machine zero: 450 down, 170 out
COSINE = 450.0 / LINK_MM
WARM = {f"temperature_link_{i}_degC": 23.0 for i in (1, 2, 3)}


def tip_with(deltas: Deltas) -> Floats:
    """The tripod's tip at machine zero with something added."""
    return predict(TRIPOD, row_at_zero(), deltas).tip_mm[0]


def test_links_that_grow_alike_lower_the_tip() -> None:
    rows = row_at_zero(values=WARM)
    grown_mm = LINK_MM * (1 + 11.5e-6 * 3.0)
    tip = predict(TRIPOD, rows, {"link": delta_mm("link_expansion", rows, 11.5)}).tip_mm[0]
    np.testing.assert_allclose(tip, [0, 0, 700 - np.sqrt(grown_mm**2 - 170**2) - 60], atol=1e-9)
    assert tip[2] < 190


def test_scales_that_grow_count_from_machine_zero() -> None:
    rows = rows_at_tips(TRIPOD, np.array([[0.0, 0.0, 190.0], [0.0, 0.0, 150.0]]), WARM)
    found = delta_mm("scale_expansion", rows, 8.0)
    np.testing.assert_allclose(found[0], 0, atol=1e-12)
    np.testing.assert_allclose(found[1], 24e-6 * (np.hypot(490, 170) - LINK_MM), rtol=1e-9)


def test_a_scale_gain_is_its_own_scales() -> None:
    rows = rows_at_tips(TRIPOD, np.array([[20.0, 10.0, 160.0]]))
    np.testing.assert_allclose(delta_mm("scale_gain", rows, 10.0, 0.0, -20.0), rows.scale_mm * [1e-5, 0, -2e-5])


def test_cyclic_error_repeats_with_the_period() -> None:
    step = np.array([0.0, 0.005, 0.010, 0.020])  # of a period of 0.020: 0, 90, 180, 360 degrees
    many = [row_at_zero(scale_mm=np.full((1, 3), s)) for s in step]
    sine = [delta_mm("scale_cyclic", one, *[0.2] * 3, *[0.0] * 9, p=0.02)[0, 0] for one in many]
    np.testing.assert_allclose(sine, [0, 0.2 * UM, 0, 0], atol=1e-12)
    second = [delta_mm("scale_cyclic", one, *[0.0] * 9, *[0.1] * 3, p=0.02)[0, 0] for one in many]
    np.testing.assert_allclose(second, [0.1 * UM, -0.1 * UM, 0.1 * UM, 0.1 * UM], atol=1e-12)


def test_backlash_puts_both_approaches_on_one_place() -> None:
    """The link stands at 10 mm; the scale, on the drive's side, shows half the play more on the way out."""
    play_um = 4.0
    for direction in (1.0, -1.0):
        still = np.zeros((1, 3))
        rows = row_at_zero(
            scale_mm=np.full((1, 3), 10 + direction * play_um / 2 * UM),
            movement=Movement(np.full((1, 3), direction), still, np.zeros((1, 9))),
        )
        np.testing.assert_allclose(rows.scale_mm + delta_mm("backlash", rows, *[play_um] * 3), 10.0, atol=1e-12)


def test_latency_brings_the_reading_up_to_date() -> None:
    """Links run at constant speed; the readings are 20 ms old."""
    speed, tau_s = np.array([[30.0, -10.0, 5.0]]), 0.020
    joint_speed = np.linspace(-1e-3, 1e-3, 9)[None]
    now_mm, now_joint_mm = np.array([[5.0, 6.0, 7.0]]), np.full((1, 9), 0.004)
    rows = row_at_zero(
        scale_mm=now_mm - speed * tau_s,
        joint_mm=now_joint_mm - joint_speed * tau_s,
        movement=Movement(np.sign(speed), speed, joint_speed),
    )
    found, _ = effect_deltas(FittedEffect(LIBRARY["gauge_latency"], np.array([20.0])), rows)
    np.testing.assert_allclose(rows.scale_mm + found["scale"], now_mm, rtol=1e-12)
    np.testing.assert_allclose(rows.joint_mm + found["joint"], now_joint_mm, rtol=1e-12)


@pytest.mark.parametrize(("id_", "port"), [("joint_comparator_gain", "joint"), ("frame_comparator_gain", "frame")])
def test_a_comparator_that_shows_too_much_is_taken_back(id_: str, port: str) -> None:
    size = 9
    true_mm = np.linspace(-8e-3, 8e-3, size)[None]
    rows = row_at_zero(**{f"{port}_mm": true_mm * 1.02})
    shown = {"joint": rows.joint_mm, "frame": rows.frame_mm}[port]
    np.testing.assert_allclose(shown + delta_mm(id_, rows, 0.02), true_mm, atol=8e-3 * 0.02**2 * 1.01)


def test_joint_holders_drift_all_alike() -> None:
    rows = row_at_zero(values={"temperature_platform_degC": 22.0})
    np.testing.assert_allclose(delta_mm("joint_comparator_drift", rows, 0.3), np.full((1, 9), -0.6 * UM))


def test_frame_rods_that_grow_hide_that_the_frame_has_grown() -> None:
    """All nine rods and distances grow by the same share: the gauges stay at zero, the base rises."""
    rows = row_at_zero(values={"temperature_frame_degC": 22.0})
    found = delta_mm("frame_rod_expansion", rows, 11.0)
    np.testing.assert_allclose(found[0, 3], 22e-6 * np.sqrt(303.108891324554**2 + 75**2 + 700**2), rtol=1e-9)
    np.testing.assert_allclose(found[0, 0], 22e-6 * 433.012701892219, rtol=1e-9)
    grown = 1 + 22e-6
    # supports on a circle of 250 grown, at the height that six grown edges of 766.5 leave above the fixed plate
    x, y = 250 * grown * np.cos(np.pi / 2), 250 * grown * np.sin(np.pi / 2)
    height = np.sqrt((766.485485837795 * grown) ** 2 - (x + 303.108891324554) ** 2 - (y - 175.0) ** 2)
    base_mm = np.array([[0, y, height - 700], [0, 0, height - 700]])
    lengths = np.full(3, LINK_MM)
    shifted = np.stack(
        [np.append((np.array([np.cos(a), np.sin(a)]) * (y - 250)), base_mm[0, 2]) for a in np.deg2rad([90, 210, 330])]
    )
    expected = solve_tip(TRIPOD, lengths, base_M=shifted)
    np.testing.assert_allclose(predict(TRIPOD, rows, {"frame": found}).tip_mm[0], expected, atol=1e-9)


def test_a_weight_hung_on_the_tip_stretches_the_links() -> None:
    """By symmetry each link carries a third: F cos = (W + 90) / 3; machine zero's own weight does not count."""
    rows = row_at_zero(values={"force_z_N": -90.0})
    np.testing.assert_allclose(rows.constants.zero_axial_force_N, 80 / 3 / COSINE, rtol=1e-9)
    np.testing.assert_allclose(delta_mm("link_elasticity", rows, 1 / 28.0), 90 / 3 / COSINE / 28.0 * UM, rtol=1e-9)
    np.testing.assert_allclose(delta_mm("link_elasticity", row_at_zero(), 1 / 28.0), 0.0, atol=1e-15)


@pytest.mark.parametrize("model", [TRIPOD, HEXAPOD], ids=["tripod", "hexapod"])
def test_elastic_energy_is_the_work_of_the_load(model: object) -> None:
    """Clapeyron: a weightless machine's tip gives by C F along the force, F^2 C / 2 being stored in the links."""
    machine = replace(TRIPOD if model is TRIPOD else HEXAPOD, weight_N=0.0)
    tip = tips(machine, 5, 4, 50.0)
    force_N = np.array([12.0, -7.0, -20.0])
    rows = rows_at_tips(machine, tip, {f"force_{axis}_N": value for axis, value in zip("xyz", force_N, strict=True)})
    compliance_um_per_N = 1e-4  # so small that the machine keeps its shape
    stretched = delta_mm("link_elasticity", rows, compliance_um_per_N)
    given = predict(machine, rows, {"link": stretched}).tip_mm - rows.tip_M_mm
    stored_twice = (rows.axial_force_N**2).sum(axis=1) * compliance_um_per_N * UM
    np.testing.assert_allclose(given @ force_N, stored_twice, rtol=1e-5)


def test_contact_is_soft_at_first_and_odd_in_the_force() -> None:
    for force_z in (-90.0, 160.0 + 90.0):  # pulled down, and pushed up by as much beyond the weight twice over
        axial = (80.0 - force_z) / 3 / COSINE
        expected = np.sign(axial) * abs(axial) ** (2 / 3) - (80 / 3 / COSINE) ** (2 / 3)
        rows = row_at_zero(values={"force_z_N": force_z})
        np.testing.assert_allclose(delta_mm("joint_contact", rows, 0.2, P=0.0), 0.2 * UM * expected, rtol=1e-9)


def test_a_preloaded_contact_gives_as_two_seats_do() -> None:
    """Each seat pushes by the power 3/2 of its approach until it opens; found by bisection of the force."""
    preload_N = 12.0
    held = preload_N ** (2 / 3)

    def displaced(force_N: float) -> float:
        def too_little(x: float) -> float:
            return math.pow(max(held + x, 0.0), 1.5) - math.pow(max(held - x, 0.0), 1.5) - force_N

        return float(brentq(too_little, -50.0, 50.0, xtol=1e-14, rtol=1e-15))

    at_zero_N = 80 / 3 / COSINE
    # the axial force is 28.5 N less a third of the load's part along the link: seats open at 33.9 N, both ways
    for axial_N in (at_zero_N, 1e-4, -1e-4, 20.0, -33.0, 33.0, 34.5, -90.0):
        rows = row_at_zero(values={"force_z_N": 80.0 - 3 * COSINE * axial_N})
        expected = displaced(axial_N) - displaced(at_zero_N)
        np.testing.assert_allclose(
            delta_mm("joint_contact", rows, 0.2, P=preload_N), 0.2 * UM * expected, rtol=1e-9, atol=1e-15
        )


@pytest.mark.parametrize("n", [3.0, 7.0])
def test_a_leaning_link_sags_with_a_power_of_its_length(n: float) -> None:
    level_part = 1 - COSINE**2
    np.testing.assert_allclose(
        delta_mm("link_sag", row_at_zero(), 5.0, n=n), -5 * UM * level_part * (LINK_MM / 500) ** n, rtol=1e-9
    )


def test_link_zeros_are_lengths() -> None:
    rows = rows_at_tips(TRIPOD, np.array([[30.0, -20.0, 170.0]]))
    z_um = [12.0, -7.0, 20.0]
    expected = solve_tip(TRIPOD, rows.link_mm[0] + UM * np.array(z_um))
    tip = predict(TRIPOD, rows, {"link": delta_mm("link_zero", rows, *z_um)}).tip_mm[0]
    np.testing.assert_allclose(tip, expected, atol=1e-9)


JOINTS = [("base_joint_position", "base_joint", "base_M"), ("platform_joint_position", "platform_joint", "joints_P")]


@pytest.mark.parametrize(("id_", "port", "moved"), JOINTS)
@pytest.mark.parametrize("model", [TRIPOD, HEXAPOD], ids=["tripod", "hexapod"])
def test_a_joint_elsewhere_moves_the_tip_as_another_solver_says(id_: str, port: str, moved: str, model: object) -> None:
    machine = TRIPOD if model is TRIPOD else HEXAPOD
    theta = np.random.default_rng(5).uniform(-100, 100, 3 * machine.links)
    rows = rows_at_tips(machine, machine.zero.contact.tip_M_mm[None] + [[25.0, -40.0, 10.0]])
    found, _ = effect_deltas(FittedEffect(LIBRARY[id_], theta), rows)
    tip = predict(machine, rows, found).tip_mm[0]
    expected = solve_tip(machine, rows.link_mm[0], **{moved: UM * theta.reshape(-1, 3)})
    np.testing.assert_allclose(tip, expected, atol=1e-8)
    assert np.linalg.norm(tip - rows.tip_M_mm[0]) > 0.01
    assert list(found) == [port]


def test_axes_turned_about_z_move_the_tip_as_another_solver_says() -> None:
    w_urad = np.array([300.0, -500.0, 200.0])
    rows = rows_at_tips(TRIPOD, np.array([[40.0, -50.0, 160.0]]))
    found, _ = effect_deltas(FittedEffect(LIBRARY["revolute_axis_tilt"], w_urad), rows)
    turned = np.stack(
        [
            Rotation.from_rotvec([0, 0, w * 1e-6]).apply(np.array(e))
            for w, e in zip(w_urad, TRIPOD.revolute_axes_P, strict=True)
        ]
    )
    expected = solve_tip(TRIPOD, rows.link_mm[0], axes_P=turned - TRIPOD.revolute_axes_P)
    np.testing.assert_allclose(predict(TRIPOD, rows, found).tip_mm[0], expected, atol=1e-7)
    assert np.linalg.norm(expected - rows.tip_M_mm[0]) > 1e-3


def test_a_platform_that_grows_is_a_larger_platform() -> None:
    rows = row_at_zero(values={"temperature_platform_degC": 24.0})
    grown = 80.0 * (1 + 12e-6 * 4)
    found, _ = effect_deltas(FittedEffect(LIBRARY["platform_expansion"], np.array([12.0])), rows)
    tip = predict(TRIPOD, rows, found).tip_mm[0]
    np.testing.assert_allclose(tip, [0, 0, 700 - np.sqrt(LINK_MM**2 - (250 - grown) ** 2) - 60], atol=1e-9)


def test_runout_along_the_axis_moves_the_tip_and_across_it_does_not() -> None:
    """Motion square to a link and to its axis changes nothing to first order."""
    rows = rows_at_tips(TRIPOD, np.array([[30.0, 20.0, 180.0]]))
    cosine_1 = [0.0] * 12
    cosine_1[3] = 2.0
    found = delta_mm("joint_runout", rows, *cosine_1, z=0.0).reshape(3, 3)
    from_zero = delta_mm("joint_runout", row_at_zero(), *cosine_1, z=1.0)
    np.testing.assert_allclose(from_zero, 0, atol=1e-15)
    axis = rows.revolute_axes_M[0, 0]
    np.testing.assert_allclose(found[0], 2 * UM * np.cos(rows.joint_angles_rad[0, 0, 0]) * axis, rtol=1e-12)
    np.testing.assert_allclose(found[1:], 0)
    before = rows.tip_M_mm[0]
    lateral = predict(TRIPOD, rows, {"base_joint": found.reshape(1, 9)}).tip_mm[0] - before
    across = np.zeros((3, 3))
    across[0] = 2 * UM * np.cross(axis, rows.directions_M[0, 0])
    none = predict(TRIPOD, rows, {"base_joint": across.reshape(1, 9)}).tip_mm[0] - before
    assert np.linalg.norm(lateral) > 1e-4
    assert np.linalg.norm(none) < 1e-7


def test_joint_angles_are_those_of_the_links() -> None:
    rows = rows_at_tips(TRIPOD, np.array([[0.0, 0.0, 190.0], [0.0, 40.0, 190.0]]))
    np.testing.assert_allclose(rows.joint_angles_rad[0], 0, atol=1e-12)
    # link 1 stays in the plane x = 0: it turns about its axis x by the change of its inclination
    _, y, z = rows.directions_M[1, 0]
    turned = np.arctan2(-z, -y) - np.arctan2(450, 170)
    assert abs(rows.joint_angles_rad[1, 0, 1]) == pytest.approx(abs(turned), abs=1e-9)
    assert rows.joint_angles_rad[1, 0, 0] == pytest.approx(0, abs=1e-12)


def test_a_tool_longer_and_offset() -> None:
    np.testing.assert_allclose(
        tip_with({"tool": delta_mm("tool_offset", row_at_zero(), 5.0, -6.0, 7.0)}), [0.005, -0.006, 190.007], atol=1e-12
    )
    rows = row_at_zero(values={"temperature_tool_degC": 25.0})
    np.testing.assert_allclose(delta_mm("tool_expansion", rows, 12.0), [[0, 0, -60 * 12e-6 * 5]], rtol=1e-12)


def test_a_tool_bends_along_the_force_wherever_the_platform_points() -> None:
    rows = rows_at_tips(TRIPOD, tips(TRIPOD, 6, 8), {"force_x_N": 10.0, "force_y_N": -20.0, "force_z_N": 5.0})
    found = delta_mm("tool_bending", rows, 0.2)
    moved = predict(TRIPOD, rows, {"tool": found}).tip_mm - rows.tip_M_mm
    np.testing.assert_allclose(moved, np.tile(UM * 0.2 * np.array([10.0, -20.0, 5.0]), (6, 1)), atol=1e-12)


def test_a_plate_warmer_on_top_bows_as_a_sphere() -> None:
    """Curvature a dT / h: over the middle the work has risen by the sagitta of the plate points' circle."""
    curvature = 8e-6 * 0.5 / 200.0
    values = {"temperature_plate_top_degC": 20.5, "temperature_plate_bottom_degC": 20.0}
    rows = rows_at_tips(TRIPOD, np.array([[0.0, 0.0, 190.0], [60.0, 30.0, 170.0]]), values)
    found = delta_mm("plate_bending", rows, 8.0)
    sphere = 1 / curvature - np.sqrt(1 / curvature**2 - 350.0**2)
    np.testing.assert_allclose(found[0], [0, 0, -sphere, 0, 0, 0], rtol=1e-4, atol=1e-15)
    np.testing.assert_allclose(found[1, 2], -curvature / 2 * (350**2 - 60**2 - 30**2), rtol=1e-9)


def test_air_drift_and_registration_are_the_instruments() -> None:
    values = {"temperature_room_degC": 21.0, "pressure_hPa": 1003.25}
    rows = rows_at_tips(TRIPOD, tips(TRIPOD, 4, 2), values, time_s=np.array([0.0, 1800.0, 3600.0, 7200.0]))
    wavelengths = -0.93e-6 - 2.7e-6
    np.testing.assert_allclose(delta_mm("reference_air_index", rows, 0.8)[:, :3], 0.8 * wavelengths * rows.tip_M_mm)
    np.testing.assert_allclose(delta_mm("reference_drift", rows, 1.0, -2.0, 3.0)[:, 2], [0, 1.5e-3, 3e-3, 6e-3])
    theta = np.array([30.0, -20.0, 10.0, 200.0, -100.0, 50.0])
    turned = Rotation.from_rotvec(1e-6 * theta[3:]).apply(np.array(rows.tip_M_mm)) + UM * theta[:3]
    shown = predict(TRIPOD, rows, {"reference": delta_mm("reference_registration", rows, *theta)})
    np.testing.assert_allclose(shown.tip_mm, turned, atol=1e-5)  # second order: (200e-6)^2 * 230 mm
    attitude = Rotation.from_matrix(shown.rotation_M_P) * Rotation.from_matrix(rows.rotation_M_P).inv()
    np.testing.assert_allclose(attitude.as_rotvec(), np.tile(1e-6 * theta[3:], (4, 1)), atol=1e-12)
