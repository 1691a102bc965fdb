"""Block by block, a comparison says what it says in memory."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from compd.comparison.alignment.align_recording import align_recording
from compd.comparison.recording_comparison import compare
from compd.comparison.stream.block_comparison import compare_blocks
from compd.comparison.stream.sample import draw_sample
from compd.errors import RecordingError
from compd.model.effects import FittedEffect
from compd.recording import Recording, read_recording
from tests.support.external_recordings import record_external
from tests.support.fixed_end_recordings import DISTANCE, PINS
from tests.support.fixed_end_recordings import recorded as recorded_from_places
from tests.support.measured import gauges, hidden, record, tripod
from tests.support.pose_recordings import hexapod, poses
from tests.support.sampled import sampled
from tests.support.streams import in_blocks

ROWS, BLOCK = 600, 70
EFFECTS = [
    hidden("link_expansion", 0.9),
    hidden("link_expansion_lag", 0.3, tau=900.0),
    replace(hidden("backlash", 0.9, 1.1, 0.8), covariance=np.eye(3)),
]


def recorded(directory: Path, reference: dict[str, Any] | None = None) -> Recording:
    """With gross rows, an empty cell and an excluded row."""
    path = record(directory, gauges(ROWS, 3), EFFECTS, reference=reference)
    lines = path.read_text(encoding="utf-8").splitlines()
    for row, cell in ((40, "999.0"), (300, "")):
        lines[row] = ",".join([*lines[row].split(",")[:-1], cell])
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    sidecar = path.with_suffix(".yaml")
    sidecar.write_text(
        sidecar.read_text(encoding="utf-8") + "excluded_rows:\n- {row: 100, reason: touched}\n", encoding="utf-8"
    )
    return read_recording(path, tripod())


REFERENCES: list[dict[str, Any] | None] = [
    None,
    {"quantity": "tool_position", "frame": "instrument", "sigma_um": 0.15},
]


@pytest.mark.parametrize("reference", sampled(REFERENCES, 2), ids=["own frame", "instrument's frame"])
@pytest.mark.parametrize("effects", [[], EFFECTS[:2], EFFECTS[1:]], ids=["no effects", "two", "others"])
def test_the_same_numbers_as_in_memory(
    tmp_path: Path, effects: list[FittedEffect], reference: dict[str, Any] | None
) -> None:
    recording = recorded(tmp_path, reference)
    whole = compare(align_recording(recording, tripod()), effects)
    stream = in_blocks(recording, tripod(), BLOCK)
    streamed = compare_blocks(stream, draw_sample(stream), effects)
    assert streamed.rows == ROWS
    assert streamed.rows_used == whole.rows_used == ROWS - 3
    assert streamed.left_out == whole.left_out
    assert streamed.outlier_rows == whole.outlier_rows == [41]
    for name in ("rms_by_axis_um", "mean_by_axis_um", "largest_by_axis_um", "constant_um"):
        np.testing.assert_allclose(getattr(streamed, name), getattr(whole, name), rtol=1e-9, atol=1e-9)
    size = np.abs(whole.residual_um[whole.used])
    np.testing.assert_allclose(streamed.p95_by_axis_um, np.quantile(size, 0.95, axis=0, method="lower"), rtol=6e-4)
    assert streamed.contributions.keys() == whole.contributions.keys()
    for source, part in whole.contributions.items():
        np.testing.assert_allclose(streamed.contributions[source], part, rtol=1e-9)
    largest = whole.aligned.recording.row[whole.used][size.argmax(axis=0)]
    assert streamed.totals.largest_row.tolist() == largest.tolist()


PLACES = {
    "fixed balls": (DISTANCE, tripod),
    "pins": (PINS, tripod),
    "attitudes, in the machine's frame": (False, hexapod),
    "attitudes, in the instrument's frame": (True, hexapod),
}


@pytest.mark.parametrize("name", PLACES)
def test_what_is_placed_from_the_recording_itself_is_placed_by_the_sample(tmp_path: Path, name: str) -> None:
    reference, machine = PLACES[name]
    effects = [hidden("link_elasticity", 20.0)]
    if isinstance(reference, dict):
        path = recorded_from_places(tmp_path, reference, tuple(effects))
    else:
        path = poses(tmp_path, tuple(effects), moved=reference)
    recording = read_recording(path, machine())
    whole = compare(align_recording(recording, machine()), effects)
    stream = in_blocks(recording, machine(), BLOCK)
    streamed = compare_blocks(stream, draw_sample(stream), effects)
    assert streamed.rows_used == whole.rows_used
    for number in ("rms_by_axis_um", "mean_by_axis_um", "largest_by_axis_um", "constant_um"):
        np.testing.assert_allclose(getattr(streamed, number), getattr(whole, number), rtol=1e-6, atol=1e-9)
    for source, part in whole.contributions.items():
        np.testing.assert_allclose(streamed.contributions[source], part, rtol=1e-6)
    few = compare_blocks(stream, draw_sample(stream, 90), effects)
    assert few.sample_rows < 0.8 * few.rows
    np.testing.assert_allclose(few.rms_by_axis_um, whole.rms_by_axis_um, rtol=0.2)


def test_a_pin_that_no_row_of_the_sample_shows_is_named(tmp_path: Path) -> None:
    recording = read_recording(recorded_from_places(tmp_path, PINS), tripod())
    assert recording.pin is not None
    pin = recording.pin.copy()
    pin[[3, 4]] = 7
    stream = in_blocks(replace(recording, pin=pin, visit=None), tripod(), BLOCK)
    sample = draw_sample(stream, 20)
    assert 7 not in sample.aligned.recording.pin
    with pytest.raises(RecordingError, match=r"too few rows have pin 7: none is among the rows that were drawn"):
        compare_blocks(stream, sample)


def test_what_a_sample_fixes_is_about_what_all_rows_say(tmp_path: Path) -> None:
    recording = recorded(tmp_path)
    whole = compare(align_recording(recording, tripod()))
    stream = in_blocks(recording, tripod(), BLOCK)
    streamed = compare_blocks(stream, draw_sample(stream, 150))
    assert 100 < streamed.sample_rows < 200
    np.testing.assert_allclose(streamed.rms_by_axis_um, whole.rms_by_axis_um, rtol=1e-9)
    assert streamed.floor.um == pytest.approx(whole.floor.um, rel=0.1)
    assert f"{streamed.sample_rows} rows of {ROWS}" in streamed.basis


def test_the_envelope_has_the_extremes_and_the_mean(tmp_path: Path) -> None:
    recording = recorded(tmp_path)
    stream = in_blocks(recording, tripod(), BLOCK)
    streamed = compare_blocks(stream, draw_sample(stream))
    envelope = streamed.totals.envelope
    largest = np.maximum(np.nanmax(envelope.largest, axis=0), -np.nanmin(envelope.smallest, axis=0))
    np.testing.assert_allclose(largest, streamed.largest_by_axis_um)
    np.testing.assert_allclose(np.nanmean(envelope.mean, axis=0), streamed.mean_by_axis_um, rtol=1e-9)


def test_an_external_model_is_compared_alike(tmp_path: Path) -> None:
    rows = np.arange(ROWS)
    columns = {"session": 1.0 + rows * 4 // ROWS, "temperature_bed_degC": 20 + rows / 100}
    whole = compare(record_external(tmp_path / "run.csv", columns, {"x": np.sin(rows / 50)}, model_mm={"x": rows / 10}))
    stream = in_blocks(whole.aligned.recording, None, BLOCK)
    streamed = compare_blocks(stream, draw_sample(stream))
    np.testing.assert_allclose(streamed.rms_by_axis_um, whole.rms_by_axis_um, rtol=1e-9)
    np.testing.assert_allclose(streamed.constant_um, whole.constant_um, rtol=1e-9)
