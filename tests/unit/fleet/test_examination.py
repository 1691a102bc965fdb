"""One recording of a fleet: its machine and model are found by name, and the numbers are those of the commands."""

from __future__ import annotations

import pickle
from datetime import UTC, datetime
from pathlib import Path

import pytest
import yaml

import compd
from compd.errors import CompdError
from compd.fleet.examination import examination
from compd.fleet.recording_result import ABOVE_FLOOR
from tests.support.measured import gauges, hidden, record
from tests.support.paths import CONFIG


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """Of machine tripod-07, whose configuration tripod-07.yaml lies in the directory above."""
    text = (CONFIG / "tripod-cmm.yaml").read_text(encoding="utf-8")
    (tmp_path / "tripod-07.yaml").write_text(text.replace("machine: tripod-cmm", "machine: tripod-07"))
    (tmp_path / "data").mkdir()
    configuration = compd.load_machine(tmp_path / "tripod-07.yaml")
    path = record(
        tmp_path / "data",
        gauges(150, 3),
        [hidden("link_expansion", 1.1)],
        machine="tripod-07",
        configuration=configuration,
    )
    sidecar = path.with_suffix(".yaml")
    contents = yaml.safe_load(sidecar.read_text()) | {"provenance": {"started_at": "2026-05-04T10:00:00+02:00"}}
    sidecar.write_text(yaml.safe_dump(contents))
    return path


def test_compare_with_a_model_fits_its_effects_on_the_recording(recording: Path, tmp_path: Path) -> None:
    machine = tmp_path / "tripod-07.yaml"
    aligned = compd.open_recording(recording, machine)
    model = compd.add_effect(None, "link_expansion", aligned)
    model.write(tmp_path / "model.yaml")
    wanted = examination("compare", [machine], [tmp_path / "model.yaml"])
    result = pickle.loads(pickle.dumps(wanted))(recording)
    comparison = compd.compare(aligned, model)
    assert result.rms_before_um == pytest.approx(comparison.rms_um)
    assert result.rms_after_um == pytest.approx(comparison.rms_um, rel=1e-3)
    (number,) = model.numbers()
    (estimate,) = result.estimates
    assert (estimate.effect, estimate.parameter, estimate.unit) == ("link_expansion", "a", "ppm/K")
    assert estimate.value == pytest.approx(number.value, rel=1e-3)
    assert estimate.standard_error == pytest.approx(number.standard_error, rel=1e-2)
    assert result.model == str(tmp_path / "model.yaml")
    assert result.started_at == datetime(2026, 5, 4, 8, tzinfo=UTC)


def test_diagnose_finds_the_effect(recording: Path, tmp_path: Path) -> None:
    result = examination("diagnose", [tmp_path / "tripod-07.yaml"])(recording)
    assert result.machine == "tripod-07"
    assert result.verdict == "identified"
    assert result.effects == ("link_expansion",)
    assert result.estimates[0].value == pytest.approx(1.1, abs=0.2)
    assert result.rms_after_um < result.rms_before_um


def test_a_machine_that_nobody_knows_is_a_problem(recording: Path) -> None:
    with pytest.raises(CompdError, match="no configuration of this machine comes with compd"):
        examination("compare")(recording)


def test_a_machine_without_a_model_has_no_effects(recording: Path, tmp_path: Path) -> None:
    result = examination("compare", [tmp_path / "tripod-07.yaml"])(recording)
    assert (result.model, result.estimates, result.verdict) == ("", (), ABOVE_FLOOR)


def test_two_files_for_one_machine_are_refused(recording: Path, tmp_path: Path) -> None:
    again = tmp_path / "again.yaml"
    again.write_bytes((tmp_path / "tripod-07.yaml").read_bytes())
    with pytest.raises(CompdError, match="is the second of its kind for machine tripod-07"):
        examination("compare", [tmp_path / "tripod-07.yaml", again])
