"""A machine without frame comparators, and without joint comparators: its frame stands still."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from compd.compensation import GaugeValues, WarmStart, compensate_cmm
from compd.configuration import load
from compd.errors import ConfigurationError
from compd.live.loop.tip_uncertainty import stated_noise, tip_uncertainty
from compd.live.machine import MachineWires
from compd.live.memory import Latest
from compd.machine_builder import build_model
from compd.machine_check import load_whole
from compd.model import EffectMemory
from compd.model.kinematics import forward_kinematics
from tests.support.paths import CONFIG

CHANGE_MM = np.array([1.0, -2.0, 3.0, 0.5, -1.5, 2.5])


def hexapod_without_frame(folder: Path, **wiring: Any) -> Path:
    data = yaml.safe_load((CONFIG / "hexapod.yaml").read_text())
    geometry = data["geometry"]
    base, platform = geometry["base"], geometry["platform"]
    # YAML 1.1 reads the key `on` as true
    geometry["tool"] = {"on" if key is True else key: value for key, value in geometry["tool"].items()}
    geometry.pop("kinematics")
    geometry.pop("plate_points_M_mm")
    base.pop("supports_B_mm")
    base.pop("support_of_joint")
    ends = zip(base.pop("joints_B_mm"), platform.pop("joints_P_mm"), strict=True)
    geometry["actuators"] = [{"kind": "extends"}] * 6
    geometry["rods"] = [
        {"actuator": i, "base_B_mm": base_B, "platform_P_mm": platform_P}
        for i, (base_B, platform_P) in enumerate(ends, start=1)
    ]
    geometry["target_fixes"] = ["x", "y", "z", "a", "b", "c"]
    used = {wire["gauge"].split(".")[0] for kind in ("scale", "quantities") for wire in data["wiring"][kind]}
    data["gauges"] = {name: options for name, options in data["gauges"].items() if name in used}
    lines = {options["line"] for options in data["gauges"].values()}
    data["lines"] = {name: line for name, line in data["lines"].items() if name in lines}
    data["wiring"] = {kind: data["wiring"][kind] for kind in ("scale", "quantities")} | wiring
    data.pop("votes", None)
    path = folder / "plain.yaml"
    path.write_text(yaml.safe_dump(data, sort_keys=False))
    return path


def test_it_is_a_whole_machine(tmp_path: Path) -> None:
    configuration = load_whole(hexapod_without_frame(tmp_path))
    assert (configuration.geometry.links, configuration.geometry.scales) == (6, 6)
    assert not configuration.geometry.has_frame


def test_the_tip_is_that_of_the_forward_kinematics(tmp_path: Path) -> None:
    configuration = load(hexapod_without_frame(tmp_path))
    model = build_model(configuration.geometry, configuration.wiring)
    zero = model.zero
    values = GaugeValues(CHANGE_MM, np.zeros(0), np.zeros(0), {})
    found, _ = compensate_cmm(model, values, WarmStart.at_zero(model))
    lengths = zero.link_length_mm + CHANGE_MM
    pose = forward_kinematics(
        model.mechanism(zero.base_joints_M_mm), lengths, zero.platform_origin_M_mm, zero.rotation_M_P
    )
    np.testing.assert_allclose(found.tip_M_mm, pose.origin_M_mm + pose.rotation_M_P @ zero.contact.tip_P_mm, atol=1e-9)
    np.testing.assert_allclose(found.correction_mm, 0.0, atol=1e-9)


def test_the_shipped_machine_shows_the_same_tip_with_its_comparators_at_zero(tmp_path: Path) -> None:
    plain, shipped = load(hexapod_without_frame(tmp_path)), load(CONFIG / "hexapod.yaml")
    tips = []
    for configuration, comparators in ((plain, 0), (shipped, 9)):
        model = build_model(configuration.geometry, configuration.wiring)
        joints = np.zeros(len(configuration.wiring.joint))
        values = GaugeValues(CHANGE_MM, joints, np.zeros(comparators), {})
        tips.append(compensate_cmm(model, values, WarmStart.at_zero(model))[0].tip_M_mm)
    np.testing.assert_allclose(tips[0], tips[1], atol=1e-9)


def test_the_tip_s_uncertainty_is_unknown_where_the_frame_s_drift_is(tmp_path: Path) -> None:
    u_um = []
    for wiring in ({}, {"frame_drift_um": 0.0}, {"frame_drift_um": 4.0}):
        configuration = load(hexapod_without_frame(tmp_path, **wiring))
        gauges = configuration.gauge_objects().items()
        channels = [f"{name}.{channel.name}" for name, gauge in gauges for channel in gauge.channels]
        wires = MachineWires(configuration, Latest(channels))
        noise = stated_noise(configuration, wires)
        model = build_model(configuration.geometry, configuration.wiring)
        values = GaugeValues(CHANGE_MM, np.zeros(0), np.zeros(0), {}, 0.0)
        u_um.append(tip_uncertainty(model, noise, values, CHANGE_MM, EffectMemory()).by_noise_um)
    assert u_um[0] is None
    assert u_um[1] is not None
    assert u_um[2] is not None
    np.testing.assert_allclose(u_um[2][:3] ** 2 - u_um[1][:3] ** 2, 16.0, rtol=1e-9)


def test_some_comparators_of_nine_are_refused(tmp_path: Path) -> None:
    gauge = yaml.safe_load((CONFIG / "hexapod.yaml").read_text())["wiring"]["scale"][0]["gauge"]
    path = hexapod_without_frame(tmp_path, frame=[{"distance": "u1", "gauge": gauge}])
    with pytest.raises(ConfigurationError, match="or none of them"):
        load(path)


def test_comparators_of_a_frame_without_places_are_refused(tmp_path: Path) -> None:
    wires = yaml.safe_load((CONFIG / "hexapod.yaml").read_text())["wiring"]["frame"]
    with pytest.raises(ConfigurationError, match="does not say where they stand"):
        load(hexapod_without_frame(tmp_path, frame=wires))


def test_actuators_that_slide_have_one_scale_each(tmp_path: Path) -> None:
    path = hexapod_without_frame(tmp_path)
    data = yaml.safe_load(path.read_text())
    tip_M = np.array(data["geometry"]["tool"]["zero_tip_M_mm"]) - data["geometry"]["tool"]["at_P_mm"]
    origin_M = np.array(data["geometry"]["base"]["origin_B0_in_M_mm"])
    for rod in data["geometry"]["rods"]:
        rod["length_mm"] = float(np.linalg.norm(np.array(rod["platform_P_mm"]) + tip_M - origin_M - rod["base_B_mm"]))
    data["geometry"]["actuators"] = [{"kind": "slides", "along_B": [0.0, 0.0, 1.0]}] * 6
    path.write_text(yaml.safe_dump(data, sort_keys=False))
    assert load_whole(path).geometry.scales == 6
