"""A machine with own kinematics: its pose, the model's effects there, and what the scales are to show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from compd.compensation import GaugeValues, WarmStart, compensate_cmm, compensate_machine_tool, external_as_applied
from compd.model import tip_derivatives
from compd.model.effects import FittedEffect
from compd.model.external import Kinematics, OwnKinematicsError, given_pose, new_external_model
from compd.model.library import find_effect

UPPER_MM, FOREARM_MM = 400.0, 300.0
SCALES_MM = np.array([12.0, -7.0])


class Arm(Kinematics):
    """Two joints in a plane; scales in mm of arc on a radius of 100 mm."""

    settings = ("forearm_mm",)
    gives = ("d_forearm_x_mm", "d_forearm_y_mm")

    def pose(self, scale_mm, settings):
        first, second = 0.4 + scale_mm[0] / 100.0, 1.3 + (scale_mm[0] + scale_mm[1]) / 100.0
        length = settings["forearm_mm"]
        x = UPPER_MM * np.cos(first) + length * np.cos(second)
        y = UPPER_MM * np.sin(first) + length * np.sin(second)
        return [x, y, 5.0, 0.0, 0.0, second]

    def columns(self, scale_mm, settings):
        second = 1.3 + (scale_mm[0] + scale_mm[1]) / 100.0
        return {"d_forearm_x_mm": np.cos(second), "d_forearm_y_mm": np.sin(second)}


class Faulty(Kinematics):
    def __init__(self, result):
        self.result = result

    def pose(self, scale_mm, settings):
        if isinstance(self.result, BaseException):
            raise self.result
        return self.result


def effect(theta, **declared):
    found = find_effect({"id": "own", "physics": "a test", **declared}, "test")
    return FittedEffect(found, np.array([theta]))


def at_reference(theta=0.06):
    number = {"dl": {"unit": "mm", "plausible": [-0.5, 0.5], "source": "drawing"}}
    return effect(theta, port="reference", sensitivity="forearm", parameters=number)


def machine(*fitted, own=None):
    size = sum(len(each.theta) for each in fitted)
    return replace(new_external_model(own or Arm(), 2), effects=fitted, covariance=np.full((size, size), 1e-6))


def values(forearm_mm=FOREARM_MM):
    return GaugeValues(SCALES_MM, np.zeros(0), np.zeros(0), {"forearm_mm": np.array(forearm_mm)}, 1.0)


def computed(model, given=None):
    return compensate_cmm(model, given or values(), WarmStart.at_zero(model))[0]


def test_without_effects_the_tip_is_where_the_class_says():
    found = computed(machine())
    np.testing.assert_allclose(found.tip_M_mm, Arm().pose(SCALES_MM, {"forearm_mm": FOREARM_MM})[:3], atol=1e-12)
    assert not found.correction_mm.any()


def test_a_parameter_of_the_kinematics_moves_the_tip_as_the_class_would_with_it():
    model = machine(at_reference())
    found, true = computed(model), Arm().pose(SCALES_MM, {"forearm_mm": FOREARM_MM + 0.06})
    np.testing.assert_allclose(found.tip_M_mm, true[:3], atol=1e-9)


def test_scales_that_are_corrected_bring_the_tip_back():
    model = machine(at_reference())
    found = computed(model)
    there = computed(model, values()._replace(scale_mm=found.scale_setpoint_mm))
    np.testing.assert_allclose(there.tip_M_mm, found.target_B_mm, atol=2e-4)
    assert np.linalg.norm(found.tip_M_mm - found.target_B_mm) > 0.05


def test_a_correction_of_which_half_is_applied_has_half_the_tip():
    model = machine(at_reference())
    found = computed(model)
    start = WarmStart.at_zero(model)
    for share in (0.0, 0.5, 1.0):
        tip_mm = external_as_applied(model, found, values(), start, share * found.correction_mm).tip_M_mm
        expected = found.target_B_mm + share * (found.tip_M_mm - found.target_B_mm)
        np.testing.assert_allclose(tip_mm, expected, atol=1e-4)


@pytest.mark.parametrize("port", ["scale", "link"])
def test_what_links_add_is_carried_by_the_derivatives(port):
    number = {"k": {"unit": "um", "plausible": [-100, 100], "source": "a guess"}}
    model = machine(effect(40.0, port=port, formula="k", parameters=number))
    found = computed(model)
    longer = Arm().pose(SCALES_MM + 0.04, {"forearm_mm": FOREARM_MM})
    np.testing.assert_allclose(found.tip_M_mm, longer[:3], atol=1e-3)
    np.testing.assert_allclose(found.rotation_M_P[1, 0], np.sin(longer[5]), atol=1e-6)
    np.testing.assert_allclose(found.correction_mm, [-0.04, -0.04], atol=1e-12)


def test_a_client_gives_pose_and_derivatives_in_place_of_the_class():
    model = new_external_model(None, 2)
    with pytest.raises(OwnKinematicsError, match="no client has given the pose"):
        computed(model)
    with pytest.raises(OwnKinematicsError, match="has no derivatives"):
        compensate_machine_tool(model, [1.0, 2.0, 3.0], None, values(), WarmStart.at_zero(model))
    pose = given_pose([1.0, 2.0, 3.0], None, np.eye(3)[:, :2], 2)
    found, _ = compensate_machine_tool(model.with_pose(pose), [1.0, 2.0, 3.0], None, values(), WarmStart.at_zero(model))
    assert found.tip_M_mm.tolist() == [1.0, 2.0, 3.0]
    assert np.isnan(found.rotation_M_P).all()


def test_an_effect_of_the_library_at_the_reference_is_the_instruments():
    instrument = FittedEffect(find_effect("reference_drift", "test"), np.zeros(3))
    assert not machine(instrument).live_effects


@pytest.mark.parametrize(
    ("result", "message"),
    [
        (ZeroDivisionError("by nothing"), "Faulty.pose: fails: ZeroDivisionError: by nothing"),
        (SystemExit(3), "fails: SystemExit"),
        ([1.0, 2.0], "3 or 6 finite numbers"),
        ([1.0, np.nan, 2.0], "3 or 6 finite numbers"),
        ("nowhere", "fails: ValueError"),
    ],
)
def test_whatever_the_class_does_wrong_is_one_error(result, message):
    with pytest.raises(OwnKinematicsError, match=message):
        computed(machine(own=Faulty(result)))


def test_the_uncertainty_follows_by_differences():
    model = machine(at_reference())
    found = tip_derivatives(
        model,
        scale_mm=SCALES_MM,
        joint_mm=np.zeros(0),
        frame_mm=np.zeros(0),
        quantities=values().quantities,
        quantities_at_zero={},
        sigmas={},
        time_s=1.0,
        effects=WarmStart.at_zero(model).effects,
    )
    for k in range(2):
        step = 1e-3 * np.eye(2)[k]
        moved = computed(model, values()._replace(scale_mm=SCALES_MM + step)).target_B_mm
        difference = (moved - computed(model).target_B_mm) / 1e-3
        np.testing.assert_allclose(found.by_gauge[:, k], difference, atol=1e-4)
    one_more = (computed(machine(at_reference(1.06))).tip_M_mm - computed(model).tip_M_mm) / 1.0
    np.testing.assert_allclose(found.by_theta[:, 0], one_more, atol=1e-9)
