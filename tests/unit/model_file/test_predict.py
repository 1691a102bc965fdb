"""`ModelFile.predict`: rows of a machine with own kinematics, or with poses that were given."""

from __future__ import annotations

import numpy as np
import pytest

from compd.errors import CompdError
from compd.model.external import Kinematics, OwnKinematicsError
from compd.model_file import ModelFile, read_model_file
from tests.support.live_models import SPINDLE_GROWTH, file_with

RADIUS = {
    "id": "radius",
    "physics": "the arm is longer than the class says",
    "port": "reference",
    "sensitivity": "radius",
    "parameters": {"radius": {"unit": "mm", "plausible": [-1, 1], "source": "a drawing"}},
}


class Arm(Kinematics):
    """A turntable of 100 mm."""

    gives = ("d_radius_x_mm", "d_radius_y_mm")

    def pose(self, scale_mm, settings):
        angle = scale_mm[0] / 100
        return [100 * np.cos(angle), 100 * np.sin(angle), 0.0, 0.0, 0.0, angle]

    def columns(self, scale_mm, settings):
        return {"d_radius_x_mm": np.cos(scale_mm[0] / 100), "d_radius_y_mm": np.sin(scale_mm[0] / 100)}


@pytest.fixture
def model(tmp_path) -> ModelFile:
    path = file_with(
        tmp_path / "m.yaml", SPINDLE_GROWTH, RADIUS, name="external", links=1, spindle_growth=2.0, radius=0.5
    )
    return read_model_file(path, "external", 1)


def test_the_class_gives_the_pose_and_the_effects_move_it(model):
    rows = {"scale_1_mm": [0.0, 50.0], "temperature_spindle_degC": [20.0, 30.0]}
    found = model.predict(rows, Arm())
    angle = np.array([0.0, 0.5])
    expected = np.stack([100.5 * np.cos(angle), 100.5 * np.sin(angle), [0.0, -0.02]], axis=1)
    np.testing.assert_allclose(found.tip_M_mm, expected, atol=1e-9)
    np.testing.assert_allclose(found.rotation_M_rad[:, 2], angle, atol=1e-12)
    bare = np.stack([100 * np.cos(angle), 100 * np.sin(angle), [0.0, 0.0]], axis=1)
    np.testing.assert_allclose(found.tip_M_mm + found.tip_correction_mm, bare, atol=1e-9)


def test_without_a_class_the_pose_stands_in_the_rows(model):
    rows = {"model_x_mm": [1.0], "model_y_mm": [2.0], "model_z_mm": [3.0], "temperature_spindle_degC": [30.0]}
    found = model.predict(rows | {"d_radius_x_mm": [1.0], "d_radius_y_mm": [0.0]})
    np.testing.assert_allclose(found.tip_M_mm, [[1.5, 2.0, 2.98]], atol=1e-12)
    assert np.isnan(found.rotation_M_rad).all()
    assert np.isnan(found.rotation_correction_rad).all()


@pytest.mark.parametrize(
    ("rows", "own", "message"),
    [
        ({"scale_1_mm": [0.0]}, Arm(), "lack columns.*\n.*temperature_spindle_degC"),
        ({"temperature_spindle_degC": [0.0]}, None, "model_x_mm, model_y_mm, model_z_mm"),
    ],
)
def test_columns_that_are_missing_are_named(model, rows, own, message):
    with pytest.raises(CompdError, match=message):
        model.predict(rows, own)


def test_a_machine_that_compd_knows_is_refused():
    with pytest.raises(CompdError, match="is of a machine that compd knows"):
        ModelFile("tripod-cmm", 3).predict({})


def test_a_class_that_fails_is_named(model):
    class Broken(Arm):
        def pose(self, scale_mm, settings):
            raise ValueError("outside")

    with pytest.raises(OwnKinematicsError, match=r"Broken.pose: fails: ValueError: outside"):
        model.predict({"scale_1_mm": [0.0], "temperature_spindle_degC": [20.0]}, Broken())
