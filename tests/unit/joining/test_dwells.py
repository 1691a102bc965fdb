"""Where a machine stood still: found in its scales, or said by the ids of points."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from compd.arrays import FloatArray
from compd.errors import RecordingError
from compd.joining.dwells import dwell_columns, find_dwells
from compd.recording import Recording, read_recording
from tests.support.points_at_rest import write_gauges
from tests.support.two_clocks import TipPath, random_path


def recorded(path: Path, time_s: FloatArray, scale_mm: FloatArray, **extra: FloatArray) -> Recording:
    write_gauges(path, time_s, scale_mm, **extra)
    return read_recording(path, needs_reference=False)


def standing_rows(motion: TipPath, time_s: FloatArray) -> list[FloatArray]:
    return [
        time_s[(arrive_s < time_s) & (time_s < leave_s)]
        for arrive_s, leave_s in zip(motion.arrive_s, motion.leave_s, strict=True)
    ]


@pytest.mark.parametrize("noise_mm", [0.0, 1e-5, 4e-4])
@pytest.mark.parametrize("seed", range(3))
def test_every_dwell_is_found_with_its_mean(tmp_path: Path, seed: int, noise_mm: float) -> None:
    rng = np.random.default_rng(seed)
    motion = random_path(rng, 30, (2.0, 5.0))
    time_s = np.arange(motion.arrive_s[0], motion.end_s, 0.1)
    scale_mm = motion.scales(time_s)
    temperature_degC = 20.0 + time_s / 100.0
    recording = recorded(
        tmp_path / "g.csv",
        time_s,
        scale_mm + rng.normal(0.0, noise_mm, scale_mm.shape),
        temperature_room_degC=temperature_degC,
    )
    dwells = find_dwells(recording)
    standing = [rows for rows in standing_rows(motion, time_s) if len(rows)]
    assert len(dwells) == len(standing)
    columns = dwell_columns(recording, [dwell.rows for dwell in dwells])
    for k, (dwell, rows_s) in enumerate(zip(dwells, standing, strict=True)):
        assert abs(dwell.middle_s - rows_s.mean()) < 0.3
        still_mm = motion.scales(rows_s).mean(axis=0)
        for link in range(3):
            assert columns[f"scale_{link + 1}_mm"][k] == pytest.approx(still_mm[link], abs=max(2e-4, noise_mm))
        assert columns["temperature_room_degC"][k] == pytest.approx(20.0 + dwell.middle_s / 100.0, abs=1e-3)
    assert set(np.unique(columns["approach_1"][1:])) == {-1.0, 1.0}


def test_a_bad_row_does_not_end_a_dwell_and_a_reversal_is_none(tmp_path: Path) -> None:
    time_s = np.arange(0.0, 20.0, 0.2)
    position_mm = np.interp(time_s, [0, 6, 8, 8.6, 10, 20], [0, 0, 20, 20, 5, 5])
    scale_mm = np.column_stack([position_mm, 2 * position_mm, -position_mm])
    scale_mm[15] += 0.5
    dwells = find_dwells(recorded(tmp_path / "g.csv", time_s, scale_mm))
    assert [round(dwell.middle_s) for dwell in dwells] == [3, 15]
    assert 15 not in dwells[0].rows


def test_ids_of_points_are_dwells_whatever_the_scales_do(tmp_path: Path) -> None:
    point = np.array([np.nan, 7, 7, np.nan, 9, 9, 7.0])
    visit = np.array([np.nan, 1, 1, np.nan, 2, 3, 4.0])
    time_s = np.arange(7.0)
    scale_mm = np.column_stack([time_s, time_s, time_s])
    dwells = find_dwells(recorded(tmp_path / "g.csv", time_s, scale_mm, point=point, visit=visit))
    assert [(dwell.point, dwell.rows.tolist()) for dwell in dwells] == [
        ("7", [1, 2]),
        ("9", [4]),
        ("9", [5]),
        ("7", [6]),
    ]


def test_text_ids_and_excluded_rows(tmp_path: Path) -> None:
    path = tmp_path / "g.csv"
    write_gauges(path, np.arange(4.0), np.ones((4, 3)), point=np.array([1, 1, 2, 3.0]))
    text = path.read_text()
    header = text.splitlines()[0].split(",").index("point")
    lines = [line.split(",") for line in text.splitlines()]
    for line, name in zip(lines[1:], ["corner", "corner", "A2", "middle"], strict=True):
        line[header] = name
    path.write_text("\n".join(",".join(line) for line in lines) + "\n")
    path.with_suffix(".yaml").write_text("machine: tripod-cmm\nexcluded_rows: [{row: 2, reason: door}]\n")
    dwells = find_dwells(read_recording(path, needs_reference=False))
    assert [(dwell.point, dwell.rows.tolist()) for dwell in dwells] == [("corner", [1]), ("A2", [2]), ("middle", [3])]


def test_a_machine_that_never_stands_is_refused(tmp_path: Path) -> None:
    time_s = np.arange(0.0, 60.0, 0.2)
    scale_mm = np.column_stack([30 * np.sin(0.3 * time_s + k) for k in range(3)])
    with pytest.raises(RecordingError, match="stands still nowhere") as caught:
        find_dwells(recorded(tmp_path / "g.csv", time_s, scale_mm))
    assert "column `point`" in str(caught.value)
