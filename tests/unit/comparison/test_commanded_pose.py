"""A machine without scales: its recordings have the pose that the controller was told."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

import compd
from compd.compensation import scales_of_command
from compd.configuration import Configuration, load
from compd.errors import RecordingError
from compd.machine_builder import build_model
from compd.machine_kinds import KINDS, machine_text
from compd.recording import read_recording
from compd.simulation import Mechanism, simulate_campaign
from compd.simulation.truth.workspace import draw_points_mm

WARM_UM = 5.0


def without_scales(folder: Path, kind: str, **wiring: float) -> Configuration:
    """A machine of this kind with one thermometer and nothing else."""
    data = yaml.safe_load(machine_text("mine", kind, KINDS[kind].usual).replace("{on: platform", '{"on": platform'))
    channel = {"name": "link_1", "function": 4, "address": 0, "type": "int16", "scale": 0.01, "unit": "degC"}
    data["gauges"] = {"thermometers": {"driver": "modbus", "line": "cabinet", "unit": 2, "channels": [channel]}}
    quantities = [{"name": "temperature_link_1_degC", "gauge": "thermometers.link_1"}]
    data["wiring"] = {"quantities": quantities, **wiring}
    path = folder / "mine.yaml"
    path.write_text(yaml.safe_dump(data, sort_keys=False))
    return load(path)


def edited(path: Path, out: Path, **columns: list[str] | None) -> Path:
    """A copy of a recording with some columns replaced, or left out (None)."""
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    for name, values in columns.items():
        for row, value in zip(rows, values or [""] * len(rows), strict=True):
            row[name] = value
    names = [*dict.fromkeys([*rows[0], *columns])]
    names = [name for name in names if columns.get(name, ()) is not None]
    with out.open("w", newline="") as file:
        writer = csv.DictWriter(file, names, extrasaction="ignore")
        writer.writeheader()
        writer.writerows(rows)
    out.with_suffix(".yaml").write_text(path.with_suffix(".yaml").read_text())
    return out


def rms_um(path: Path, configuration: Configuration) -> float:
    return compd.compare(compd.open_recording(path, machine=configuration)).rms_um


@pytest.mark.parametrize("kind", list(KINDS))
def test_the_drives_are_those_of_the_drawing(tmp_path: Path, kind: str) -> None:
    configuration = without_scales(tmp_path, kind)
    mechanism = Mechanism(configuration.geometry)
    drives_mm = draw_points_mm(mechanism, np.random.default_rng(3), 6)
    told = [mechanism.told_pose(drive_mm, mechanism.posture0) for drive_mm in drives_mm]
    model = build_model(configuration.geometry, configuration.wiring)
    tips_mm, turns_rad = (np.array(part) for part in zip(*told, strict=True))
    found_mm = scales_of_command(model, tips_mm, turns_rad)
    np.testing.assert_allclose(found_mm, drives_mm, atol=1e-6)
    unfixed = [name not in configuration.geometry.mechanism.target_fixes for name in "xyz"]
    tips_mm[:, unfixed] = np.nan
    np.testing.assert_allclose(scales_of_command(model, tips_mm, turns_rad), drives_mm, atol=1e-6)
    tips_mm[2, ~np.array(unfixed)] = 1e5
    tips_mm[4] = np.nan
    lost = np.isnan(scales_of_command(model, tips_mm, turns_rad)).all(axis=1)
    # links of a 3-RPS as long as that have their lengths
    assert lost.tolist() == [False, False, kind != "3-rps", False, True, False], "out of reach, not given"


def test_a_campaign_is_compared_and_its_cause_found(tmp_path: Path) -> None:
    configuration = without_scales(tmp_path, "6-ups", frame_drift_um=WARM_UM)
    path = tmp_path / "poses.csv"
    simulate_campaign(configuration, path, seed=3, effects=["base_joint_position=10"])
    recording = read_recording(path, configuration)
    assert recording.scale_mm is None
    assert not any(name.startswith(("scale_", "approach_")) for name in recording.columns)
    assert not any(name.startswith("commanded_") for name in recording.quantities), "no covariates"
    comparison = compd.compare(compd.open_recording(path, machine=configuration))
    assert comparison.uncertainty.total_um[comparison.used].min() >= WARM_UM
    assert "unmeasured by 5 um" in comparison.gauges.how
    verdict = compd.diagnose(compd.open_recording(path, machine=configuration))
    assert (verdict.verdict, [step.effect.id for step in verdict.steps]) == ("identified", ["base_joint_position"])


def test_a_quaternion_gives_the_same(tmp_path: Path, hexapod: tuple[Path, Configuration]) -> None:
    path, configuration = hexapod
    whole = read_recording(path, configuration)
    quaternions = Rotation.from_rotvec(whole.commanded_rotation_rad).as_quat()
    columns = {
        f"commanded_q{part}": list(map(repr, values))
        for part, values in zip("xyzw", quaternions.T.tolist(), strict=True)
    }
    vector = dict.fromkeys(("commanded_rx_rad", "commanded_ry_rad", "commanded_rz_rad"))
    turned = edited(path, tmp_path / "turned.csv", **columns, **vector)
    by_vector, by_quaternion = (rms_um(each, configuration) for each in (path, turned))
    assert by_quaternion == pytest.approx(by_vector, rel=1e-9)
    at_zero = edited(path, tmp_path / "zero.csv", **vector)
    rows = compd.open_recording(at_zero, machine=configuration).rows
    np.testing.assert_allclose(rows.rotation_M_P, np.broadcast_to(np.eye(3), (len(rows.time_s), 3, 3)), atol=1e-9)


@pytest.fixture(scope="module")
def hexapod(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Configuration]:
    """A campaign on a 6-UPS without scales, and its configuration."""
    folder = tmp_path_factory.mktemp("hexapod")
    configuration = without_scales(folder, "6-ups")
    simulate_campaign(configuration, folder / "poses.csv", seed=3)
    return folder / "poses.csv", configuration


@pytest.mark.parametrize(
    ("columns", "what"),
    [
        (
            {f"commanded_{name}": None for name in ("x_mm", "y_mm", "z_mm", "rx_rad", "ry_rad", "rz_rad")},
            "commanded_x_mm",
        ),
        ({"commanded_ry_rad": None}, "missing: commanded_ry_rad"),
        ({"scale_1_mm": ["1.0"] * 609}, "1 scale columns, mine has 0"),
        ({"commanded_q_mm": ["1.0"] * 609}, "commanded_q_mm"),
    ],
)
def test_mistakes_are_named(
    tmp_path: Path, hexapod: tuple[Path, Configuration], columns: dict[str, list[str] | None], what: str
) -> None:
    path, configuration = hexapod
    columns = {name: values and values[: read_recording(path, configuration).rows] for name, values in columns.items()}
    with pytest.raises(RecordingError, match=what):
        read_recording(edited(path, tmp_path / "wrong.csv", **columns), configuration)


def test_the_pose_that_the_controller_was_told_stands_for_the_scales_of_a_machine_where_none_was_recorded(
    tmp_path: Path, hexapod: tuple[Path, Configuration]
) -> None:
    path, _ = hexapod
    (tmp_path / "scales.yaml").write_text(machine_text("mine", "6-ups", KINDS["6-ups"].usual))
    configuration = load(tmp_path / "scales.yaml")
    assert read_recording(path, configuration).commanded_mm is not None
    one = {"scale_1_mm": ["1.0"] * read_recording(path, configuration).rows}
    with pytest.raises(RecordingError, match="1 scale columns, mine has 6"):
        read_recording(edited(path, tmp_path / "one.csv", **one), configuration)
