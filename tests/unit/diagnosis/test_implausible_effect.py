"""An effect that explains much with an implausible number is asked about, in the headline; nothing else is."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

import compd
from compd.diagnosis import Diagnosis, summary_lines
from compd.diagnosis.words.summary_lines import WIDTH
from compd.machine_kinds import KINDS, machine_text
from compd.simulation import simulate_campaign


def machine(folder: Path, tolerance: str) -> Path:
    path = folder / f"{tolerance}.yaml"
    text = machine_text("hexa", "6-ups", KINDS["6-ups"].usual)
    assert text.count("tolerance_mm: machined") == 1
    path.write_text(text.replace("tolerance_mm: machined", f"tolerance_mm: {tolerance}"))
    return path


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A 6-UPS whose links are 0.2 mm other than drawn."""
    folder = tmp_path_factory.mktemp("hexa")
    simulate_campaign(machine(folder, "machined"), folder / "zeros.csv", seed=3, effects=["link_zero=200"])
    return folder / "zeros.csv"


def diagnosed(recorded: Path, tolerance: str, **options: list[str]) -> Diagnosis:
    folder = recorded.parent
    return compd.diagnose(compd.open_recording(recorded, machine=machine(folder, tolerance), **options))


@pytest.mark.long
@pytest.mark.sample
def test_the_number_and_the_question_are_in_the_headline(recorded: Path) -> None:
    diagnosis = diagnosed(recorded, "ground")
    assert diagnosis.verdict in ("partial", "unexplained")
    assert diagnosis.asked is not None
    assert diagnosis.asked.effect == "link_zero"
    assert abs(diagnosis.asked.number.value) > 100
    assert "link_zero would take 99 % of the squared error" in diagnosis.summary
    assert "this machine is declared good to 0.005 mm. Is it?" in diagnosis.summary
    heading, *lines = summary_lines(diagnosis)
    assert heading.endswith("link_zero would take 99 %, with an implausible number")
    assert len(heading) <= WIDTH
    assert "--range link_zero.z=LOW..HIGH" in " ".join(" ".join(lines).split())
    why = {candidate.effect: candidate.why for candidate in diagnosis.candidates if candidate.status == "not_testable"}
    assert why["tool_expansion"].endswith("a acts like tool_offset d_z"), "its combination is named"
    assert "k_1, k_2, k_3, k_4, k_5 and k_6 together move these rows too little" in why["scale_gain"]
    asked = diagnosis.as_json()["asked"]
    assert (asked["effect"], asked["plausible"]) == ("link_zero", [-5.0, 5.0])


@pytest.mark.parametrize(("tolerance", "ranges"), [("hand-built", []), ("ground", ["link_zero.z=-0.5..0.5mm"])])
def test_what_is_plausible_is_named(recorded: Path, tolerance: str, ranges: list[str]) -> None:
    diagnosis = diagnosed(recorded, tolerance, ranges=ranges)
    assert diagnosis.asked is None
    assert "asked" not in diagnosis.as_json()
    assert "link_zero" in [
        name for step in diagnosis.steps for name in (step.effect.id, *(r.name for r in step.rivals))
    ]


def test_no_event_is_told_where_geometry_explains_the_rows(tmp_path: Path) -> None:
    """One half of the workspace is visited first: in time the error of base joints looks like a step."""
    recorded, ground = tmp_path / "joints.csv", machine(tmp_path, "ground")
    simulate_campaign(ground, recorded, seed=3, effects=["base_joint_position=200"])
    with recorded.open(newline="") as file:
        rows = list(csv.DictReader(file))
    times = sorted((row["time_s"] for row in rows), key=float)
    middle = sorted(float(row["reference_y_mm"]) for row in rows)[len(rows) // 2]
    rows.sort(key=lambda row: float(row["reference_y_mm"]) > middle)
    for row, time in zip(rows, times, strict=True):
        row |= {"time_s": time, "session": "1"}
    path = tmp_path / "halves.csv"
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    path.with_suffix(".yaml").write_text(recorded.with_suffix(".yaml").read_text())
    diagnosis = compd.diagnose(compd.open_recording(path, machine=ground))
    assert diagnosis.asked is not None
    assert not [finding for finding in diagnosis.depends_on if finding.is_change]
    assert "changed" not in diagnosis.summary
