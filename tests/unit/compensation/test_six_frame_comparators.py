"""u1 to u6 alone: t1 to t3 stay as at machine zero, in the compensation, its uncertainty, recordings and words."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from compd.columns import frame_columns
from compd.compensation import WarmStart, compensate_cmm
from compd.configuration import load
from compd.errors import ConfigurationError, RecordingError
from compd.live.loop.tip_uncertainty import stated_noise
from compd.live.machine import MachineWires
from compd.live.memory import Latest
from compd.live.service.readings_message import columns
from compd.live.wired_trust import wired_channels
from compd.machine_builder import build_model
from compd.not_measured import not_measured
from compd.recording import read_recording
from compd.simulation import simulate_campaign
from tests.support.paths import CONFIG
from tests.unit.model.test_tip_derivatives import LIVE, after_moving, derivatives, with_effects

both = pytest.mark.parametrize("name", ["tripod-cmm.yaml", "hexapod.yaml"])


def six(folder: Path, name: str, without: tuple[str, ...] = ("t1", "t2", "t3")) -> Path:
    """A shipped machine without some of its frame comparators."""
    text = (CONFIG / name).read_text()
    wires = yaml.safe_load(text)["wiring"]["frame"]
    lines = [line for line in text.splitlines() if not any(f"distance: {distance}," in line for distance in without)]
    assert len(text.splitlines()) - len(lines) == len(without)
    assert len(wires) == 9
    path = folder / name
    path.write_text("\n".join(lines) + "\n")
    return path


@both
def test_the_tip_is_that_of_nine_with_t_at_machine_zero(name: str) -> None:
    model = with_effects(name, LIVE)
    values, effects = after_moving(model)
    values.frame_mm[:3] = 0.0
    alone = values._replace(frame_mm=values.frame_mm[3:])
    nine, six_ = (compensate_cmm(model, each, WarmStart.at_zero(model))[0] for each in (values, alone))
    np.testing.assert_array_equal(six_.tip_M_mm, nine.tip_M_mm)
    np.testing.assert_array_equal(six_.scale_setpoint_mm, nine.scale_setpoint_mm)
    moved = compensate_cmm(model, alone._replace(frame_mm=alone.frame_mm + 0.01), WarmStart.at_zero(model))[0]
    assert np.abs(moved.tip_M_mm - six_.tip_M_mm).max() > 1e-3, "the frame acts"
    by_nine, by_six = (derivatives(model, each, effects) for each in (values, alone))
    kept = np.delete(by_nine.by_gauge, np.arange(3) + model.scales + len(values.joint_mm), axis=1)
    np.testing.assert_array_equal(by_six.by_gauge, kept)
    np.testing.assert_array_equal(by_six.by_theta, by_nine.by_theta)


@both
def test_each_gauge_keeps_its_distance(tmp_path: Path, name: str) -> None:
    configuration, shipped = load(six(tmp_path, name)), load(CONFIG / name)
    found = []
    for each in (configuration, shipped):
        gauges = each.gauge_objects().items()
        wires = MachineWires(each, Latest([f"{name}.{c.name}" for name, gauge in gauges for c in gauge.channels]))
        lengths = wired_channels(each, wires, build_model(each.geometry, each.wiring))
        frame = {wired.meaning: wired.length_mm for wired in lengths if wired.kind == "frame"}
        found.append((frame, {column["column"]: column["channel"] for column in columns(wires)}, wires))
    (frame, by_column, wires), (nine, by_column_of_nine, _) = found
    assert frame == {meaning: length_mm for meaning, length_mm in nine.items() if " u" in meaning}
    assert by_column == {c: channel for c, channel in by_column_of_nine.items() if not c.startswith("frame_t")}
    assert stated_noise(configuration, wires) is None, "nobody states how far the rest of the frame moves the tip"
    assert [clause for clause in not_measured(configuration) if "t1 to t3" in clause and "frame_drift_um" in clause]


@pytest.mark.parametrize("without", [("u1",), ("t1",), ("t1", "t2"), ("t1", "t2", "t3", "u4")])
def test_other_parts_of_the_nine_are_refused(tmp_path: Path, without: tuple[str, ...]) -> None:
    with pytest.raises(ConfigurationError, match=r"u1\.\.u6 alone; or none of them") as refusal:
        load(six(tmp_path, "hexapod.yaml", without))
    missing = [problem.what.split()[2] for problem in refusal.value.problems if "is wired 0 times" in problem.what]
    assert missing == [distance for distance in without if len(without) < 3 or distance[0] == "u"]


def test_a_recording_has_the_six_columns(tmp_path: Path) -> None:
    configuration = load(six(tmp_path, "hexapod.yaml"))
    simulate_campaign(configuration, tmp_path / "own.csv")
    recording = read_recording(tmp_path / "own.csv", configuration)
    assert [column for column in recording.gauge_columns if "frame" in column] == list(frame_columns(6))
    assert recording.frame_mm is not None
    assert recording.frame_mm.shape[1] == 6
    with pytest.raises(RecordingError, match="6 frame comparator columns, hexapod has 9"):
        read_recording(tmp_path / "own.csv", load(CONFIG / "hexapod.yaml"))
