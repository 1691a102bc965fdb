"""The configuration of `machine: external`: its keys, the class's file and its hash, and what it says of faults."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from compd.configuration import json_schema
from compd.errors import ConfigurationError, PluginError
from compd.machine_builder import build_model, own_kinematics
from compd.machine_check import load_whole
from compd.operation_settings import Wiring
from tests.support.external_machines import GANTRY, class_geometry, external_yaml, gantry_file


def refused(path: Path) -> str:
    with pytest.raises(ConfigurationError) as caught:
        load_whole(path)
    return str(caught.value)


def test_a_class_with_its_hash_is_a_whole_machine(tmp_path):
    configuration = load_whole(external_yaml(tmp_path, class_geometry(tmp_path)))
    assert str(configuration).startswith(f"external: {tmp_path}/gantry.py:Gantry, 3 links")
    model = build_model(configuration.geometry, configuration.wiring)
    assert model.own.pose([1, 2, 3], {})[:3] == pytest.approx([1, 2.001, 297])
    assert build_model(load_whole(external_yaml(tmp_path, {"kinematics": "client"})).geometry, Wiring()).own is None


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"sha256": None}, "sha256 is missing"),
        ({"sha256": "0" * 64}, "the class's file has another content than the configuration lists"),
        ({"sha256": "none"}, "geometry.sha256"),
        ({"links": 0}, "links is 0, and a class needs scales"),
        ({"links": 7}, "geometry.links"),
        ({"kinematics": "gantry.py:Gantry"}, "geometry.kinematics"),
        ({"platform": {"weight_N": 1}}, "geometry.platform"),
    ],
)
def test_what_is_wrong_is_said_at_its_key(tmp_path, changed, words):
    geometry = {k: v for k, v in class_geometry(tmp_path, **changed).items() if v is not None}
    text = refused(external_yaml(tmp_path, {**geometry, "links": geometry["links"]}))
    assert words in text
    assert f"{tmp_path}/external.yaml:" in text


def test_the_hash_of_a_file_and_a_client_exclude_each_other(tmp_path):
    text = refused(external_yaml(tmp_path, {"kinematics": "client", "sha256": "0" * 64}))
    assert "a client gives the pose" in text


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (GANTRY.replace("class Gantry", "class Other"), "no such subclass of `compd.Kinematics`"),
        (GANTRY.replace("(compd.Kinematics)", ""), "no such subclass of `compd.Kinematics`"),
        (GANTRY + "\n    def __init__(self, length):\n        pass\n", "cannot be made without arguments: TypeError"),
        ("import nothing_of_this_name\n" + GANTRY, "cannot be loaded: No module named 'nothing_of_this_name'"),
        (GANTRY.replace("return [x,", "return [1 // 0,"), "Gantry.pose fails: ZeroDivisionError"),
        (GANTRY.replace("return [x,", "return [x,\n            1, 2,"), "Gantry.pose gives no such numbers"),
    ],
)
def test_a_class_that_cannot_be_used_is_refused_by_check(tmp_path, text, words):
    assert words in refused(external_yaml(tmp_path, class_geometry(tmp_path, text)))


def test_a_setting_that_no_gauge_measures_is_named(tmp_path):
    text = GANTRY.replace("gives =", 'settings = ("head_1",)\n    gives =')
    said = refused(external_yaml(tmp_path, class_geometry(tmp_path, text)))
    assert "the class needs head_1, which no gauge measures" in said
    assert "temperature_spindle_degC" in said


def test_the_file_is_executed_only_with_its_hash(tmp_path):
    marker = tmp_path / "executed"
    configuration = load_whole(external_yaml(tmp_path, class_geometry(tmp_path)))
    gantry_file(tmp_path, f"open({str(marker)!r}, 'w').close()\n" + GANTRY)
    with pytest.raises(PluginError, match="another content"):
        own_kinematics(configuration.geometry)
    assert not marker.exists()


def test_joint_and_frame_comparators_and_too_many_scales_are_refused(tmp_path):
    path = external_yaml(tmp_path, class_geometry(tmp_path))
    data = yaml.safe_load(path.read_text())
    data["geometry"]["links"] = 2
    data["wiring"]["joint"] = [{"link": 1, "role": "S", "gauge": "plc.y"}]
    data["wiring"]["frame"] = [{"distance": "t1", "gauge": "plc.z"}]
    path.write_text(yaml.safe_dump(data, sort_keys=False))
    text = refused(path)
    assert "none: compd knows no links of this machine" in text
    assert "the geometry does not say where they stand" in text
    assert "there is no such link" in text


def test_a_new_version_of_the_class_keeps_machine_zero_and_changes_the_configuration(tmp_path):
    before = load_whole(external_yaml(tmp_path, class_geometry(tmp_path)))
    after = load_whole(external_yaml(tmp_path, class_geometry(tmp_path, GANTRY + "\n# checked\n")))
    assert before.zero_hash == after.zero_hash
    assert before.config_hash != after.config_hash


def test_what_needs_the_geometry_says_so(tmp_path):
    configuration = load_whole(external_yaml(tmp_path, class_geometry(tmp_path)))
    with pytest.raises(ConfigurationError, match=r"geometry\.base: this needs a machine whose geometry compd knows"):
        _ = configuration.geometry.base


def test_the_schema_allows_both_forms(tmp_path):
    forms = json_schema()["properties"]["geometry"]["anyOf"]
    assert ["platform" in form["properties"] for form in forms] == [True, False]
    assert "sha256" in forms[1]["properties"]
