"""A hidden effect found from gauges and a list of points without time, in the instrument's own frame.

The list is joined by order and by name. What is found is also found in the campaign's own recording, which has the
reference in every row; it is compared with the sealed answer last.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from compd.cli.app import app
from compd.comparison import compare, open_recording
from compd.diagnosis import diagnose
from compd.model.library import load_library
from compd.recording import read_recording, sidecar_contents, write_recording
from compd.simulation import simulate_campaign
from tests.support.points_at_rest import in_own_frame

# Numbers of hidden causes that are plain and in the library; nothing else is known of them here.
NUMBERS = (4, 8)
LIBRARY = list(load_library().values())


def split(campaign: Path, directory: Path) -> tuple[Path, Path]:
    """The gauges of a campaign as a recording of their own, and a list of the points: name, x, y, z by blanks."""
    whole = read_recording(campaign)
    assert whole.reference_mm is not None
    assert whole.point is not None
    columns = {name: values for name, values in whole.columns.items() if not name.startswith("reference_")}
    write_recording(directory / "gauges.csv", columns, sidecar_contents(whole.machine))
    rest = np.flatnonzero(whole.point >= 0)
    rows = zip(whole.point[rest], in_own_frame(whole.reference_mm[rest]), strict=True)
    text = "\n".join(f"P{point:03d} {x:.6f} {y:.6f} {z:.6f}" for point, (x, y, z) in rows)
    (directory / "points.txt").write_text(text + "\n", encoding="utf-8")
    return directory / "gauges.csv", directory / "points.txt"


@pytest.mark.long
@pytest.mark.parametrize("by", ["order", "name"])
@pytest.mark.parametrize("number", NUMBERS)
def test_found_as_in_the_campaigns_own_recording(tmp_path: Path, number: int, by: str) -> None:
    files = simulate_campaign("tripod-cmm", tmp_path / "campaign.csv", seed=number, hidden=number)
    gauges, listed = split(files.recording, tmp_path)
    out = tmp_path / "joined.csv"
    words = ["recording", "join", str(gauges), str(listed), str(out), "--by", by, "--unit", "mm", "--sigma-um", "0.15"]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.output
    assert f"joined by {by}: " in result.output
    assert "left out" not in result.output
    joined, own = open_recording(out), open_recording(files.recording)
    before = compare(joined)
    diagnosis = diagnose(joined, (), None, LIBRARY)
    own_diagnosis = diagnose(own, (), None, LIBRARY)
    verdict, own_verdict = diagnosis.as_json(), own_diagnosis.as_json()
    named = {name for step in verdict["steps"] for name in (step["effect"], *step["rivals"])}
    own_named = {name for step in own_verdict["steps"] for name in (step["effect"], *step["rivals"])}
    after = compare(joined, diagnosis.after.fitted)
    assert before.floor_ratio > 2.0
    assert after.floor_ratio < 1.5
    assert named & own_named
    secret = json.loads(files.answer.read_text(encoding="utf-8"))
    assert named >= set(secret["answers"]), (secret["answers"], verdict["steps"])
