"""One recording of a fleet: its machine and model are found by name, and the numbers are those of the commands."""

from __future__ import annotations

import pickle
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

import pytest
import yaml

import compd
from compd.comparison import ComparisonCriteria
from compd.comparison import open as open_module
from compd.diagnosis import Criteria
from compd.errors import CompdError
from compd.fleet.fleet_recording import FleetRecording
from compd.fleet.machine_examination import examination
from compd.fleet.recording_result import ABOVE_FLOOR
from compd.fleet.recordings import find_recordings
from tests.support.measured import gauges, hidden, record
from tests.support.paths import CONFIG


def of(path: Path, name: str = "tripod-07") -> FleetRecording:
    """The recording among those of a fleet, where its machine has this name."""
    (recording,) = find_recordings([path]).recordings
    return replace(recording, machine=name)


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
    result = pickle.loads(pickle.dumps(wanted))(of(recording))
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
    result = examination("diagnose", [tmp_path / "tripod-07.yaml"])(of(recording))
    assert result.machine == "tripod-07"
    assert result.verdict == "identified"
    assert result.effects == ("link_expansion",)
    assert result.estimates[0].value == pytest.approx(1.1, abs=0.2)
    assert result.rms_after_um < result.rms_before_um


def test_a_machine_that_nobody_knows_is_a_problem(recording: Path) -> None:
    with pytest.raises(CompdError, match="no configuration of this machine comes with compd"):
        examination("compare")(of(recording))


def test_a_machine_without_a_model_has_no_effects(recording: Path, tmp_path: Path) -> None:
    result = examination("compare", [tmp_path / "tripod-07.yaml"])(of(recording))
    assert (result.model, result.estimates, result.verdict) == ("", (), ABOVE_FLOOR)


def test_two_files_for_one_machine_are_refused(recording: Path, tmp_path: Path) -> None:
    again = tmp_path / "again.yaml"
    again.write_bytes((tmp_path / "tripod-07.yaml").read_bytes())
    with pytest.raises(CompdError, match="is the second of its kind for machine tripod-07"):
        examination("compare", [tmp_path / "tripod-07.yaml", again])


def test_machines_that_are_built_alike_have_a_model_each(recording: Path, tmp_path: Path) -> None:
    machine = tmp_path / "tripod-07.yaml"
    (tmp_path / "models").mkdir()
    for name in ("m1", "m2"):
        compd.add_effect(None, "link_expansion", compd.open_recording(recording, machine)).write(
            tmp_path / "models" / f"{name}.yaml"
        )
    wanted = examination("compare", [machine], [f"{tmp_path}/models/{{machine}}.yaml"])
    results = [wanted(of(recording, name)) for name in ("m1", "m2", "m3")]
    assert [Path(result.model).name for result in results] == ["m1.yaml", "m2.yaml", ""]
    with pytest.raises(CompdError, match="is the second of its kind for machine tripod-07"):
        examination("compare", [machine], [f"{tmp_path}/models/*.yaml"])


def test_other_criteria_are_handed_on(recording: Path, tmp_path: Path) -> None:
    machine = [tmp_path / "tripod-07.yaml"]
    blind = examination("diagnose", machine, criteria=Criteria(least_sigmas=1e3))
    assert blind(of(recording)).effects == ()
    strict = examination("compare", machine, comparison=ComparisonCriteria(fewest_rows=10**6))
    with pytest.raises(CompdError, match="too few rows can be compared"):
        strict(of(recording))


def test_what_a_result_follows_from_changes_its_basis(recording: Path, tmp_path: Path) -> None:
    machine, effects = tmp_path / "tripod-07.yaml", tmp_path / "effects.yaml"
    effects.write_text("[]")

    def basis(**changes: object) -> str:
        return examination(**{"command": "diagnose", "machines": [machine], "effects": [effects], **changes}).basis(
            of(recording)
        )  # type: ignore[arg-type]

    seen = {basis(), basis(), basis(command="compare"), basis(effects=[])}
    assert len(seen) == 3
    assert basis(criteria=Criteria(), comparison=ComparisonCriteria()) in seen
    seen |= {basis(criteria=Criteria(least_sigmas=3.0)), basis(comparison=ComparisonCriteria(outlier_sigmas=6.0))}
    assert len(seen) == 5
    for file in (machine, effects, recording, recording.with_suffix(".yaml")):
        with file.open("a") as opened:
            opened.write("\n")
        seen.add(basis())
    assert len(seen) == 9
    recording.unlink()
    assert examination("diagnose").basis(FleetRecording(recording, "tripod-07")) == ""


def test_of_a_long_recording_a_sample_is_examined(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wanted = examination("compare", [tmp_path / "tripod-07.yaml"])
    in_memory = wanted(of(recording))
    monkeypatch.setattr(open_module, "LONG_ROWS", 10)
    monkeypatch.setattr(open_module, "open_sample", partial(open_module.open_sample, rows=100))
    of_sample = wanted(of(recording))
    assert of_sample.rms_before_um == pytest.approx(in_memory.rms_before_um, rel=0.1)
    assert of_sample.rows < in_memory.rows
    assert examination("diagnose", [tmp_path / "tripod-07.yaml"])(of(recording)).effects == ("link_expansion",)
