"""Two clocks, two rates: the planted offset is found again, or the join is refused in words."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from compd.arrays import FloatArray
from compd.cli.app import app
from compd.errors import RecordingError
from compd.instruments import ReadOptions, Track, read_export
from compd.instruments import track_of as track_of_export
from compd.joining.by_time import Instrument, JoinResult, match_by_time
from compd.joining.clock_offset import agreement_curve, estimate_offset
from compd.recording import Recording, read_recording, write_recording
from tests.support.points_at_rest import write_gauges
from tests.support.sampled import sampled
from tests.support.two_clocks import TipPath, random_path, track_of

SCALE_NOISE_MM, TRACKER_NOISE_MM = 1e-4, 0.005
SIDECAR = {"machine": "tripod-cmm"}


def join_reference(
    recording: Recording,
    track: Track,
    out: Path,
    instrument: Instrument,
    offset_s: float | None = None,
    moving: bool = False,
) -> JoinResult:
    """Write `out`: what `match_by_time` puts together."""
    joined = match_by_time(recording, track, instrument, offset_s, moving)
    write_recording(out, joined.columns, joined.sidecar)
    return joined


def gauges(path: Path, motion: TipPath, time_s: FloatArray, rng: np.random.Generator, **extra: FloatArray) -> Path:
    """A recording of gauges alone at `time_s`."""
    scale_mm = motion.scales(time_s) + rng.normal(0.0, SCALE_NOISE_MM, (len(time_s), 3))
    columns = {"time_s": time_s, **{f"scale_{i + 1}_mm": scale_mm[:, i] for i in range(3)}}
    columns |= {f"joint_{k}_um": np.zeros(len(time_s)) for k in range(1, 10)}
    names = ("t1", "t2", "t3", "u1", "u2", "u3", "u4", "u5", "u6")
    columns |= {f"frame_{name}_um": np.zeros(len(time_s)) for name in names}
    write_recording(path, {**columns, **extra}, SIDECAR)
    return path


def read_track(path: Path, **said: Any) -> Track:
    return track_of_export(read_export(path, ReadOptions(**said)))


def export(path: Path, track: Track, head: str = "t_s,Tracker X [mm],Tracker Y [mm],Tracker Z [mm]") -> Path:
    rows = np.column_stack([track.time_s, track.position_mm])
    path.write_text("\n".join([head, *(",".join(f"{value:.6f}" for value in row) for row in rows)]) + "\n")
    return path


@pytest.mark.parametrize("seed", sampled(range(3), 3))
@pytest.mark.parametrize(("period_s", "instrument_period_s"), sampled([(0.2, 0.1), (0.02, 0.1), (0.1, 0.013)], 3))
def test_offset_from_recorded_motion(period_s: float, instrument_period_s: float, seed: int) -> None:
    """Rows that follow the motion: 1 ms, where the instrument's noise alone is worth 5 um / (40 mm/s) a sample."""
    rng = np.random.default_rng(seed)
    motion = random_path(rng, 60, (1.5, 4.0))
    planted_s = float(rng.uniform(-500, 500))
    track, _ = track_of(motion, rng, planted_s, instrument_period_s, TRACKER_NOISE_MM)
    time_s = np.arange(20.0, motion.end_s - 30.0, period_s)
    scale_mm = motion.scales(time_s) + rng.normal(0.0, SCALE_NOISE_MM, (len(time_s), 3))
    offset = estimate_offset(time_s, scale_mm, track)
    assert abs(offset.offset_s - planted_s) < 0.001
    assert abs(offset.offset_s - planted_s) < 3 * offset.std_s < 0.01
    assert offset.agreement > 0.999
    assert offset.runner_up is not None
    assert offset.runner_up[1] < 0.8


@pytest.mark.parametrize("seed", sampled(range(6), 3))
def test_offset_from_one_row_per_dwell(seed: int) -> None:
    """One row in each dwell of 1.5 to 4 s, no row in motion: a fifth of a second, and an uncertainty that says
    that no offset within a dwell is better than another."""
    rng = np.random.default_rng(seed)
    motion = random_path(rng, 80, (1.5, 4.0))
    planted_s = float(rng.uniform(-500, 500))
    track, _ = track_of(motion, rng, planted_s, 0.1, TRACKER_NOISE_MM)
    time_s = (motion.arrive_s + motion.leave_s)[:-1] / 2 + rng.uniform(-0.3, 0.3, 79)
    offset = estimate_offset(time_s, motion.scales(time_s), track)
    assert abs(offset.offset_s - planted_s) < 0.2
    assert 0.1 < offset.std_s < 0.8


def test_offset_from_one_link_by_interferometer() -> None:
    rng = np.random.default_rng(3)
    motion = random_path(rng, 40, (1.0, 3.0))
    instrument_s = np.arange(0.0, motion.end_s, 0.05)
    length_mm = motion.scales(instrument_s)[:, 1:2] + rng.normal(0.0, 1e-4, (len(instrument_s), 1))
    track = Track(Path("laser.csv"), instrument_s - 12.345, length_mm, ("length",))
    time_s = np.arange(5.0, motion.end_s - 5.0, 0.1)
    assert abs(estimate_offset(time_s, motion.scales(time_s), track).offset_s - 12.345) < 0.001


def test_the_curve_of_agreement_has_its_peak_at_the_offset_and_the_next_best_below() -> None:
    rng = np.random.default_rng(12)
    motion = random_path(rng, 60, (1.5, 4.0))
    track, _ = track_of(motion, rng, -77.7, 0.05, TRACKER_NOISE_MM)
    time_s = np.arange(10.0, motion.end_s, 0.1)
    curve = agreement_curve(time_s, motion.scales(time_s), track)
    estimated = estimate_offset(time_s, motion.scales(time_s), track)
    best = np.nanargmax(curve.agreement)
    assert abs(curve.offset_s[best] - estimated.offset_s) < 0.2
    assert curve.agreement[best] == pytest.approx(estimated.agreement, abs=0.01)
    assert (np.diff(curve.offset_s) > 0).all()
    assert estimated.runner_up is not None
    other = np.abs(curve.offset_s - estimated.offset_s) > curve.window_s
    assert np.nanmax(curve.agreement[other]) < curve.agreement[best] - 0.1
    # over all offsets at which the two overlap
    assert curve.offset_s[0] < time_s[0] - track.time_s[-1] + 1.0
    assert curve.offset_s[-1] > time_s[-1] - track.time_s[0] - 1.0


def test_joined_recording_is_right_where_the_machine_dwells(tmp_path: Path) -> None:
    rng = np.random.default_rng(11)
    motion = random_path(rng, 60, (1.5, 4.0))
    track, frame = track_of(motion, rng, -77.7, 0.05, TRACKER_NOISE_MM)
    time_s = np.arange(10.0, motion.end_s + 5.0, 0.1)
    humidity = {"humidity_pct": np.linspace(40, 50, len(time_s))}
    recording = read_recording(gauges(tmp_path / "g.csv", motion, time_s, rng, **humidity), needs_reference=False)
    result = join_reference(
        recording, read_track(export(tmp_path / "t.csv", track)), tmp_path / "out.csv", Instrument(sigma_um=5)
    )
    joined = read_recording(tmp_path / "out.csv")
    assert joined.reference is not None
    assert (joined.reference.quantity, joined.reference.frame) == ("tool_position", "instrument")
    assert joined.reference_sigma_mm == pytest.approx([0.005] * 3)
    assert joined.reference_mm is not None
    matched = np.isfinite(joined.reference_mm).all(axis=1)
    assert matched.sum() == result.matched
    assert result.matched + sum(result.left_out.values()) == joined.rows
    assert result.left_out["outside the instrument's time"] >= 49
    truth_mm = motion.tip(joined.time_s[matched]) @ frame[:3] + frame[3]
    error_mm = joined.reference_mm[matched] - truth_mm
    assert np.sqrt(np.mean(error_mm**2)) < 1.2 * TRACKER_NOISE_MM
    assert np.abs(error_mm).max() < 0.05, "no row in motion among them"
    standing = (motion.arrive_s[:, None] + 0.2 < time_s) & (time_s < motion.leave_s[:, None] - 0.2)
    assert matched[: len(time_s)][standing.any(axis=0)].mean() > 0.95, "dwells are matched"
    assert np.array_equal(joined.columns["humidity_pct"], recording.columns["humidity_pct"])
    provenance = joined.sidecar.provenance["join"]
    assert provenance["gauges_sha256"] == recording.sha256
    assert provenance["offset_s"] == pytest.approx(-77.7, abs=0.001)


def standing_still(motion: TipPath) -> TipPath:
    return TipPath(motion.arrive_s, motion.leave_s, np.repeat(motion.target_mm[:1], len(motion.target_mm), axis=0))


def repeating(motion: TipPath) -> TipPath:
    """Ten moves, again and again, each time alike."""
    count = len(motion.leave_s) // 10
    cycle_s = motion.leave_s[9]
    arrive_s = np.concatenate([motion.arrive_s[:10] + k * cycle_s for k in range(count)])
    leave_s = np.concatenate([motion.leave_s[:10] + k * cycle_s for k in range(count)])
    return TipPath(arrive_s, leave_s, np.tile(motion.target_mm[:10], (count, 1)))


def test_ambiguous_or_absent_motion_is_refused() -> None:
    rng = np.random.default_rng(5)
    motion = random_path(rng, 60, (1.5, 4.0))
    other = random_path(rng, 60, (1.5, 4.0))
    time_s = np.arange(5.0, motion.end_s - 60.0, 0.2)
    track, _ = track_of(motion, rng, 30.0, 0.1, TRACKER_NOISE_MM)
    again, _ = track_of(repeating(motion), rng, 30.0, 0.1, TRACKER_NOISE_MM)
    again_s = np.arange(5.0, repeating(motion).leave_s[39], 0.2)
    still, _ = track_of(standing_still(motion), rng, 30.0, 0.1, 0.0001)
    noise_mm = rng.normal(0.0, SCALE_NOISE_MM, (len(time_s), 3))
    for seconds, scale_mm, seen, wanted in (
        (time_s, standing_still(motion).scales(time_s) + noise_mm, track, "the machine stands still"),
        (time_s, motion.scales(time_s), still, "the instrument stands still"),
        (again_s, repeating(motion).scales(again_s), again, "two offsets fit equally well"),
        (time_s, other.scales(time_s), track, "no offset makes the instrument follow"),
        (time_s[:9], motion.scales(time_s[:9]), track, "too few rows"),
    ):
        with pytest.raises(RecordingError, match=wanted) as caught:
            estimate_offset(seconds, scale_mm, seen)
        assert "--offset S" in str(caught.value)


def test_offset_by_hand_and_refusals_write_nothing(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    motion = standing_still(random_path(rng, 20, (1.5, 4.0)))
    track, _ = track_of(motion, rng, 30.0, 0.1, 0.001)
    path = gauges(tmp_path / "g.csv", motion, np.arange(5.0, 40.0, 0.5), rng)
    export(tmp_path / "t.csv", track)
    arguments = ["recording", "join", str(path), str(tmp_path / "t.csv"), str(tmp_path / "out.csv")]
    result = CliRunner().invoke(app, arguments)
    assert isinstance(result.exception, RecordingError)
    assert "stands still" in str(result.exception)
    result = CliRunner().invoke(app, [*arguments, "--offset", "1000"])
    assert isinstance(result.exception, RecordingError)
    assert "no row matches" in str(result.exception)
    assert not (tmp_path / "out.csv").exists()
    assert not (tmp_path / "out.yaml").exists()
    result = CliRunner().invoke(app, [*arguments, "--offset", "30"])
    assert result.exit_code == 0, result.output
    assert "clock offset +30.0000 s, given" in result.output
    assert "70 of 70 rows have a reference now" in result.output
    again = CliRunner().invoke(app, [*arguments, "--offset", "30"])
    assert isinstance(again.exception, RecordingError)
    assert "is there already" in str(again.exception)


def test_gauges_without_times_are_refused(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    motion = random_path(rng, 20, (2.0, 4.0))
    track, _ = track_of(motion, rng, 0.0, 0.1, TRACKER_NOISE_MM)
    file = write_gauges(tmp_path / "g.csv", None, motion.scales(np.arange(20.0, 40.0, 0.2)))
    recording = read_recording(file, needs_reference=False)
    with pytest.raises(RecordingError, match="has no `time_s` to compare with the instrument's"):
        join_reference(recording, track, tmp_path / "joined.csv", Instrument())


def test_command_shows_the_offset_and_its_uncertainty(tmp_path: Path) -> None:
    rng = np.random.default_rng(8)
    motion = random_path(rng, 30, (1.5, 4.0))
    track, _ = track_of(motion, rng, 4.5, 0.1, TRACKER_NOISE_MM)
    path = gauges(tmp_path / "g.csv", motion, np.arange(0.0, motion.end_s, 0.2), rng)
    names = export(tmp_path / "t.csv", track, "when_s,a,b,c")
    arguments = [
        "recording",
        "join",
        str(path),
        str(names),
        str(tmp_path / "out.csv"),
        "--time",
        "when_s",
        "--unit",
        "mm",
    ]
    result = CliRunner().invoke(app, [*arguments, "--x", "a", "--y", "b", "--z", "c", "--frame", "machine"])
    assert result.exit_code == 0, result.output
    assert "clock offset +4.5" in result.output
    assert "s (one standard uncertainty)" in result.output
    assert "column 2 'a', as --x says, mm by --unit" in result.output
    joined = read_recording(tmp_path / "out.csv")
    assert joined.reference is not None
    assert joined.reference.frame == "machine"


def test_exclusions_keep_their_rows(tmp_path: Path) -> None:
    rng = np.random.default_rng(8)
    motion = random_path(rng, 10, (1.5, 4.0))
    path = gauges(tmp_path / "g.csv", motion, np.arange(0.0, motion.end_s, 0.2), rng)
    lines = path.read_text().split("\n")
    path.write_text("\n".join([*lines[:5], "", *lines[5:]]))
    path.with_suffix(".yaml").write_text("machine: tripod-cmm\nexcluded_rows: [{row: 9, reason: door}]\n")
    recording = read_recording(path, needs_reference=False)
    track, _ = track_of(motion, rng, 4.5, 0.1, TRACKER_NOISE_MM)
    join_reference(recording, track, tmp_path / "out.csv", Instrument(), 4.5)
    joined = read_recording(tmp_path / "out.csv")
    assert joined.time_s[joined.excluded] == recording.time_s[recording.excluded]
    assert list(joined.sidecar.excluded.values()) == ["door"]


EXPORTS: dict[str, tuple[str, list[str]]] = {
    "no time": ("a_mm,x_mm\n1,2\n2,3\n", ["no column is a time", "--time", "--rate-hz"]),
    "no position": ("t_s,a,b\n1,2,3\n2,3,4\n", ["no column is a position or a length", "--x, --y, --z"]),
    "two x": ("t_s,x_mm,raw_x_mm\n1,2,3\n2,3,4\n", ["2 columns may be x", "x_mm, raw_x_mm", "--x"]),
    "no unit": ("t_s,x\n1,2\n2,3\n", ["no unit of x in its name", "--unit"]),
    "time without unit": ("time,x_mm\n1,2\n2,3\n", ["no unit of time"]),
    "time backwards": ("t_s,x_mm\n1,2\n3,3\n2,4\n4,5\n", ["t.csv:4: time does not rise"]),
    "two rows": ("t_s,x_mm\n1,2\n2,3\n", ["2 rows have a time and x"]),
}


@pytest.mark.parametrize("mistake", EXPORTS)
def test_export_is_refused_in_words(tmp_path: Path, mistake: str) -> None:
    text, wanted = EXPORTS[mistake]
    path = tmp_path / "t.csv"
    path.write_text(text)
    with pytest.raises(RecordingError) as caught:
        read_track(path)
    for part in wanted:
        assert part in str(caught.value)


def test_export_is_read_in_its_own_units(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text(
        "Time [ms],X (m),Y (m),temperature_degC\n1000,1,0.002,20\n2000,1.5,,20\n3000,2,0.004,20\n4000,2,0.004,20\n"
    )
    track = read_track(path)
    assert track.axes == ("x", "y")
    assert track.time_s == pytest.approx([1.0, 3.0, 4.0])
    assert track.position_mm[0] == pytest.approx([1000.0, 2.0])
    assert track.left_out == {"with an empty cell": 1}


def test_length_needs_its_link(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    motion = random_path(rng, 40, (1.0, 3.0))
    path = gauges(tmp_path / "g.csv", motion, np.arange(5.0, motion.end_s - 5.0, 0.1), rng)
    recording = read_recording(path, needs_reference=False)
    seen_s = np.arange(0.0, motion.end_s, 0.05)
    track = Track(tmp_path / "l.csv", seen_s - 12.0, motion.scales(seen_s)[:, :1], ("length",))
    with pytest.raises(RecordingError, match="--link"):
        join_reference(recording, track, tmp_path / "out.csv", Instrument())
    join_reference(recording, track, tmp_path / "out.csv", Instrument(link=1))
    joined = read_recording(tmp_path / "out.csv")
    assert joined.reference_links == (1,)
    assert joined.reference is not None
    assert joined.reference.quantity == "link_length"


def test_a_length_from_a_fixed_ball_is_a_distance(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    motion = random_path(rng, 40, (1.0, 3.0))
    path = gauges(tmp_path / "g.csv", motion, np.arange(5.0, motion.end_s - 5.0, 0.1), rng)
    recording = read_recording(path, needs_reference=False)
    seen_s = np.arange(0.0, motion.end_s, 0.05)
    length_mm = np.linalg.norm(motion.tip(seen_s) - [0.0, 0.0, -150.0], axis=1)[:, None]
    track = Track(tmp_path / "bar.csv", seen_s - 12.0, length_mm, ("length",))
    with pytest.raises(RecordingError, match="--ball"):
        join_reference(recording, track, tmp_path / "out.csv", Instrument(link=1, ball=1))
    join_reference(recording, track, tmp_path / "out.csv", Instrument(sigma_um=0.5, ball=7))
    joined = read_recording(tmp_path / "out.csv")
    assert joined.reference is not None
    assert joined.reference.quantity == "distance"
    assert joined.reference_distance_mm is not None
    measured = np.isfinite(joined.reference_distance_mm)
    assert measured.sum() > 100
    expected_mm = np.linalg.norm(motion.tip(joined.time_s) - [0.0, 0.0, -150.0], axis=1)
    np.testing.assert_allclose(joined.reference_distance_mm[measured], expected_mm[measured], atol=2e-3)
    assert set(joined.columns["ball"][measured]) == {7.0}


def test_how_well_an_attitude_is_known_needs_an_attitude(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    motion = random_path(rng, 20, (1.0, 3.0))
    path = gauges(tmp_path / "g.csv", motion, np.arange(5.0, motion.end_s - 5.0, 0.1), rng)
    track, _ = track_of(motion, rng, 0.0, 0.1, TRACKER_NOISE_MM)
    recording = read_recording(path, needs_reference=False)
    with pytest.raises(RecordingError, match="sigma-urad"):
        join_reference(recording, track, tmp_path / "out.csv", Instrument(sigma_urad=5.0), 0.0)


def test_an_attitude_is_joined_and_a_turn_on_the_spot_is_motion(tmp_path: Path) -> None:
    """The platform turns by 0.1 rad about the target between 20 s and 25 s, while the target itself stands still."""
    rng = np.random.default_rng(5)
    motion = random_path(rng, 30, (1.5, 4.0))
    standing = standing_still(motion)
    time_s = np.arange(2.0, 40.0, 0.5)
    recording = read_recording(gauges(tmp_path / "g.csv", standing, time_s, rng), needs_reference=False)
    seen_s = np.arange(0.0, 50.0, 0.1)
    rotation_rad = np.column_stack([np.interp(seen_s, [20, 25], [0.3, 0.4]), np.zeros((len(seen_s), 2))])
    track = Track(tmp_path / "p.csv", seen_s, standing.tip(seen_s), ("x", "y", "z"), rotation_rad=rotation_rad)
    result = join_reference(recording, track, tmp_path / "out.csv", Instrument(), 0.0)
    joined = read_recording(tmp_path / "out.csv")
    assert joined.reference is not None
    assert joined.reference.quantity == "tool_pose"
    assert joined.reference_rotation_rad is not None
    moving = (time_s > 19.8) & (time_s < 25.2)
    assert result.left_out == {"in motion": int(moving.sum())}
    assert np.array_equal(np.isnan(joined.reference_rotation_rad).any(axis=1), moving)
    assert np.ptp(joined.reference_rotation_rad[time_s < 19]) == pytest.approx(0.3)
    np.testing.assert_allclose(joined.reference_rotation_rad[time_s > 26, 0], 0.4, atol=1e-12)


def test_whole_seconds_are_for_rows_at_rest_alone(tmp_path: Path) -> None:
    """Ten rows in each second with stamps of whole seconds: dwells of 4 s are matched, and their edges are not."""
    rng = np.random.default_rng(5)
    motion = random_path(rng, 40, (3.0, 6.0))
    time_s = np.arange(5.0, motion.end_s - 5.0, 0.2)
    recording = read_recording(gauges(tmp_path / "g.csv", motion, time_s, rng), needs_reference=False)
    seen_s = np.arange(0.0, motion.end_s, 0.1) + 0.05
    rows = [
        f"16:{int(second) // 60:02}:{int(second) % 60:02},{','.join(f'{value:.6f}' for value in tip)}"
        for second, tip in zip(seen_s, motion.tip(seen_s) + rng.normal(0.0, 1e-4, (len(seen_s), 3)), strict=True)
    ]
    (tmp_path / "t.csv").write_text("\n".join(["Time,X [mm],Y [mm],Z [mm]", *rows]) + "\n")
    track = read_track(tmp_path / "t.csv")
    with pytest.raises(RecordingError, match="too coarse for rows in motion"):
        join_reference(recording, track, tmp_path / "out.csv", Instrument(), moving=True)
    result = join_reference(recording, track, tmp_path / "out.csv", Instrument(frame="machine"))
    assert 100 < result.matched < len(time_s)
    joined = read_recording(tmp_path / "out.csv")
    assert joined.reference_mm is not None
    error_mm = joined.reference_mm - motion.tip(joined.time_s)
    assert np.nanmax(np.abs(error_mm)) < 0.002
    assert joined.sidecar.provenance["join"]["time_std_s"] == pytest.approx(0.2887, abs=1e-4)
