"""Changes in time: an effect that begins or grows at a moment is found with its time, and names no cause."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from compd.comparison import AlignedRecording, open_recording
from compd.diagnosis.candidate_criteria import CandidateCriteria
from compd.diagnosis.candidates.candidates import library_pool
from compd.diagnosis.candidates.changes import change_candidates, moments_s
from compd.diagnosis.recording_diagnosis import diagnose
from compd.diagnosis.words.summary_lines import summary_lines
from tests.support.external_recordings import along, record_external
from tests.support.hidden_effects import LIBRARY, record_with_effects

ROWS = 240
PLAY = along("x", "play", "k * moved_1", parameters={"k": {"unit": "um", "plausible": [0, 20], "source": "a test"}})
GAIN = along("x", "gain", "k * position_mm / 100")


def stage(path: Path, before_um: float, after_um: float, at: int = 120) -> AlignedRecording:
    """A stage in two sessions; its play changes at a row, by default at the second's first."""
    rng = np.random.default_rng(1)
    moved, position = rng.choice([-1.0, 1.0], ROWS), rng.uniform(0, 100, ROWS)
    rows = np.arange(ROWS)
    play = np.where(rows < at, before_um, after_um)
    columns = {"moved_1": moved, "position_mm": position, "session": 1.0 + (rows >= 120)}
    return record_external(path, columns, {"x": play * moved}, model_mm={"x": position})


def test_moments_are_starts_of_sessions_and_quantiles_of_the_rows(tmp_path: Path) -> None:
    aligned = stage(tmp_path / "run.csv", 2.0, 2.0)
    times_s = moments_s(aligned)
    assert times_s == sorted(times_s)
    assert 1200.0 in times_s
    assert len(times_s) == CandidateCriteria.moments + 1
    assert 0.0 < times_s[0] < times_s[-1] < aligned.rows.time_s[-1]


def test_of_many_sessions_not_every_start_is_tried(tmp_path: Path) -> None:
    """The starts that are tried lie over the whole recording."""
    columns = {"session": 1.0 + np.arange(ROWS) // 2}
    aligned = record_external(tmp_path / "run.csv", columns, {"x": np.zeros(ROWS)})
    times_s = moments_s(aligned)
    assert CandidateCriteria.moments < len(times_s) <= CandidateCriteria.moments + CandidateCriteria.max_session_starts
    assert np.diff(times_s).max() < aligned.rows.time_s[-1] / CandidateCriteria.moments


def test_a_change_acts_from_its_moment_on_and_may_have_either_sign(tmp_path: Path) -> None:
    aligned = stage(tmp_path / "run.csv", 2.0, 5.0)
    (play,) = library_pool(aligned, [PLAY], ()).candidates
    early, late = change_candidates([play], aligned, [400.0, 1200.0])
    assert (late.columns_um[:120] == 0.0).all()
    np.testing.assert_array_equal(late.columns_um[120:], play.columns_um[120:])
    assert early.limits.tolist() == [[-20.0, 20.0]]  # play may shrink, its own range is 0 to 20
    assert (late.name, late.kind, late.time_s) == ("play change", "change", 1200.0)
    assert late.parameter_count == 1 + CandidateCriteria.searched_constant


def test_a_drift_that_begins_does_so_at_nought(tmp_path: Path) -> None:
    """From its first value on it would be a step, which something that was moved makes."""
    aligned = stage(tmp_path / "run.csv", 2.0, 2.0)
    drift = along("x", "drift", "k * time_s / 3600")
    (whole,) = library_pool(aligned, [drift], []).candidates
    (change,) = change_candidates([whole], aligned, [1200.0])
    column = change.columns_um[:, 0, 0]
    after = aligned.rows.time_s >= 1200.0
    assert not column[~after].any()
    assert column[after][0] == 0.0
    np.testing.assert_allclose(np.diff(column[after]), np.diff(whole.columns_um[after, 0, 0]))


def test_an_effect_that_does_not_vary_after_a_moment_is_no_change_of_it(tmp_path: Path) -> None:
    moved = np.where(np.arange(ROWS) < 200, np.resize([1.0, -1.0], ROWS), -1.0)
    columns = {"moved_1": moved, "position_mm": np.linspace(0, 100, ROWS)}
    shifted_um = 2.0 * moved + 1.5 * (np.arange(ROWS) >= 200)
    aligned = record_external(tmp_path / "run.csv", columns, {"x": shifted_um}, model_mm={"x": columns["position_mm"]})
    candidates = library_pool(aligned, [PLAY, GAIN], ()).candidates
    found = change_candidates(candidates, aligned, [1500.0, 2000.0])
    assert {(change.whole.name, change.time_s) for change in found} == {
        ("play", 1500.0),
        ("gain", 1500.0),
        ("gain", 2000.0),
    }
    lines = " ".join(" ".join(summary_lines(diagnose(aligned, (), None, [PLAY, GAIN]))).split())
    assert "every row is shifted alike" in lines


def test_play_that_grows_is_found_with_its_time_beside_the_play_that_was_there(tmp_path: Path) -> None:
    diagnosis = diagnose(stage(tmp_path / "run.csv", 2.0, 5.0), (), None, [PLAY, GAIN])
    assert diagnosis.verdict == "partial"
    assert [step.effect.id for step in diagnosis.steps] == ["play"]
    change = diagnosis.depends_on[0]
    assert (change.form, change.effect, change.time_s) == ("change", "play", 1200.0)
    assert change.parameters[0]["k"] == pytest.approx(3.0, abs=0.2)
    assert change.heldout_rms_um < 0.55  # of a noise of 0.5
    assert change.p_value <= 0.01
    assert change.as_json()["time_s"] == 1200.0


def test_play_that_begins_is_a_change_alone(tmp_path: Path) -> None:
    diagnosis = diagnose(stage(tmp_path / "run.csv", 0.0, 4.0), (), None, [PLAY, GAIN])
    change = diagnosis.depends_on[0]
    assert (change.form, change.effect, change.time_s) == ("change", "play", 1200.0)
    assert diagnosis.steps == ()


def test_all_that_is_shifted_from_a_row_on_is_a_change_with_its_time(tmp_path: Path) -> None:
    """A knocked mirror: no effect changes, and time drives nothing."""
    rng = np.random.default_rng(1)
    moved = rng.choice([-1.0, 1.0], ROWS)
    shift = np.where(np.arange(ROWS) < 150, 0.0, 9.0)
    aligned = record_external(tmp_path / "run.csv", {"moved_1": moved}, {"x": 2.0 * moved + shift})
    diagnosis = diagnose(aligned, (), None, [PLAY])
    finding = diagnosis.depends_on[0]
    assert (finding.form, finding.covariate) == ("step", "time_s")
    assert finding.time_s == pytest.approx(1500.0, abs=50.0)
    text = "\n".join(summary_lines(diagnosis))
    assert f"from {finding.time_s:.0f} s on (row {finding.time_s / 10 + 2:.0f}) every row is shifted alike" in text
    assert "find out what changed" in text


def test_play_that_stays_has_no_change(tmp_path: Path) -> None:
    diagnosis = diagnose(stage(tmp_path / "run.csv", 3.0, 3.0), (), None, [PLAY, GAIN])
    assert (diagnosis.verdict, diagnosis.depends_on) == ("identified", ())


def test_a_change_between_two_moments_is_dated_within_one_of_them(tmp_path: Path) -> None:
    diagnosis = diagnose(stage(tmp_path / "run.csv", 2.0, 5.0, at=165), (), None, [PLAY, GAIN])
    change = diagnosis.depends_on[0]
    assert change.effect == "play"
    assert change.time_s == pytest.approx(1650.0, abs=10.0 * ROWS / CandidateCriteria.moments)


@pytest.mark.long
def test_backlash_of_a_known_machine_that_grows_after_a_crash(tmp_path: Path) -> None:
    still = record_with_effects(tmp_path / "run.csv", 1, {})
    crash_s = float(still.rows.time_s[still.rows.session_start][2])
    grown_um = still.columns(LIBRARY["backlash"], {}) @ [1.2, 1.0, 1.4] * 1e3
    grown_um[still.rows.time_s < crash_s] = 0.0
    aligned = record_with_effects(tmp_path / "run.csv", 1, {"backlash": (0.8, 1.1, 0.6)}, extra_um=grown_um)
    diagnosis = diagnose(aligned, (), None, list(LIBRARY.values()))
    assert diagnosis.verdict == "partial"
    assert [step.effect.id for step in diagnosis.steps] == ["backlash"]
    change = diagnosis.depends_on[0]
    assert (change.form, change.effect, change.time_s) == ("change", "backlash", crash_s)
    assert list(change.parameters[0].values()) == pytest.approx([1.2, 1.0, 1.4], abs=0.2)


def test_without_the_times_of_rows_nothing_has_happened(tmp_path: Path) -> None:
    """The order of rows may be that of places."""
    stage(tmp_path / "run.csv", 2.0, 8.0)
    text = (tmp_path / "run.csv").read_text(encoding="utf-8")
    without = "\n".join(line.partition(",")[2] for line in text.splitlines())
    (tmp_path / "run.csv").write_text(f"{without}\n", encoding="utf-8")
    aligned = open_recording(tmp_path / "run.csv")
    assert not moments_s(aligned)
    diagnosis = diagnose(aligned, (), None, [PLAY, GAIN])
    assert not any(finding.is_change for finding in diagnosis.depends_on)
