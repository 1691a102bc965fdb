"""A 6-UPS without scales, live: a pose comes over TARGET, and one corrected by geometry and temperatures goes out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from compd.client import connect
from compd.machine_builder import build_model
from compd.machine_kinds import KINDS, machine_text
from compd.operation_settings import Wiring
from compd.rotation import rotation_matrix
from tests.support.external_machines import served
from tests.support.live_models import file_with
from tests.support.model_machines import inverse_pose
from tests.support.patience import PATIENCE_S
from tests.support.running_daemon import supervised
from tests.system.processes.test_own_kinematics import first, is_ok, take_zero

# Like every link's own, so that one thermometer serves: 10 ppm/K of each link, since machine zero.
GROWTH = {
    "id": "growth",
    "physics": "the links grow",
    "port": "link",
    "formula": "k * link_mm * (temperature_spindle_degC - 20)",
    "parameters": {"k": {"unit": "um/mm/K", "plausible": [-1, 1], "source": "a guess"}},
}
WARM_K, EXPANSION = 30.0, 10e-6
FRAME_DRIFT_UM = 5.0


def test_a_commanded_pose_is_corrected_by_temperatures(tmp_path: Path) -> None:
    text = machine_text("hexa", "6-ups", KINDS["6-ups"].usual).replace("{on: platform", '{"on": platform')
    geometry = yaml.safe_load(text)["geometry"]
    wiring = {
        "quantities": [
            {"name": "temperature_spindle_degC", "gauge": "plc.spindle", "noise": 0.01, "fastest_change": 1000000}
        ],
        "frame_drift_um": FRAME_DRIFT_UM,
    }
    model_file = file_with(tmp_path / "growth.yaml", GROWTH, name="hexa", links=6, growth=1e3 * EXPANSION)
    tip_mm, turn_rad = np.array([20.0, -10.0, 500.0]), np.array([0.02, 0.0, 0.01])
    with served(tmp_path, geometry, machine="hexa", wiring=wiring) as device, supervised(device.configuration):
        socket = device.configuration.sockets.unix.path
        with connect(socket, PATIENCE_S) as client, connect(socket, PATIENCE_S) as observer:
            take_zero(client)
            setpoints = observer.watch()
            alone = first(setpoints, lambda s: s["state"] == "refused")
            assert "there are no scales" in alone["reason"]
            client.target(tip_mm.tolist(), turn_rad.tolist())
            cold = first(setpoints, is_ok)
            assert cold["mode"] == "machine_tool"
            assert cold["tip_correction_mm"] == pytest.approx([0, 0, 0], abs=1e-6)
            assert not {"scale_setpoint_mm", "correction_mm"} & cold.keys()
            assert cold["u_tip_um"] > 3**0.5 * FRAME_DRIFT_UM

            client.model(str(model_file))
            device.values["spindle"] = 20.0 + WARM_K
            client.target(tip_mm.tolist(), turn_rad.tolist())
            wanted_um = 1e3 * EXPANSION * WARM_K * 480.0
            warm = first(
                setpoints, lambda s: is_ok(s) and 1e3 * np.linalg.norm(s["tip_correction_mm"]) > 0.5 * wanted_um
            )
            assert warm["u_tip_um"] > cold["u_tip_um"]
    # what the controller drives by the drawing, told the corrected pose, are links that are shorter by what they grow
    loaded = device.configuration
    model = build_model(loaded.geometry, Wiring())
    mechanism = model.mechanism(model.zero.base_joints_M_mm)
    tool = model.zero.contact.tip_P_mm
    R = rotation_matrix(turn_rad)
    asked = inverse_pose(model, mechanism, tip_mm, tool, R).link_length_mm
    told = inverse_pose(
        model,
        mechanism,
        tip_mm + warm["tip_correction_mm"],
        tool,
        rotation_matrix(np.array(warm["rotation_correction_rad"])) @ R,
    ).link_length_mm
    np.testing.assert_allclose(told + EXPANSION * WARM_K * asked, asked, atol=2e-4)
    assert np.linalg.norm(warm["sources_mm"]["growth"]) == pytest.approx(
        np.linalg.norm(warm["tip_correction_mm"]), rel=0.05
    )
