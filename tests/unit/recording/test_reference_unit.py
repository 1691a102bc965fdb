"""A reference in another unit than um: how it is read, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from compd.comparison import open_recording
from compd.errors import RecordingError
from compd.recording.merge import merge_recordings
from compd.recording.reader import read_recording
from compd.units import REFERENCE_UNITS
from tests.support.external import Floats, write_external
from tests.support.measured import gauges, record

ARCSEC = {"quantity": "tool_position", "unit": "arcsec", "sigma": 1.5}


def pointing(ending: str = "arcsec", rows: int = 40) -> dict[str, Floats]:
    rng = np.random.default_rng(1)
    return {
        f"{kind}_{axis}_{ending}": np.round(rng.normal(0, 100, rows), 3)
        for kind in ("model", "reference")
        for axis in "xy"
    }


def problems_of(directory: Path, columns: dict[str, Floats], reference: dict[str, Any]) -> str:
    with pytest.raises(RecordingError) as error:
        open_recording(write_external(directory, columns, reference))
    return str(error.value)


@pytest.mark.parametrize("unit", [unit for unit in REFERENCE_UNITS if unit != "um"])
def test_one_unit_counts_as_a_micrometre(tmp_path: Path, unit: str) -> None:
    columns = pointing(REFERENCE_UNITS[unit])
    reference = {"quantity": "tool_position", "unit": unit, "sigma": [1.5, 2.0]}
    recording = read_recording(write_external(tmp_path, columns, reference))
    assert recording.unit == unit
    assert recording.reference_axes == ("x", "y")
    assert recording.reference_mm is not None
    assert recording.model_mm is not None
    ending = REFERENCE_UNITS[unit]
    np.testing.assert_allclose(recording.reference_mm[:, 1] * 1e3, columns[f"reference_y_{ending}"])
    np.testing.assert_allclose(recording.model_mm[:, 0] * 1e3, columns[f"model_x_{ending}"])
    np.testing.assert_allclose(recording.reference_sigma_mm * 1e3, [1.5, 2.0])
    assert recording.quantities == {}


def test_lengths_of_links_may_be_in_another_unit(tmp_path: Path) -> None:
    columns = {"model_link_1_um_per_m": np.zeros(9), "reference_link_1_um_per_m": np.arange(9.0)}
    recording = read_recording(write_external(tmp_path, columns, {"quantity": "link_length", "unit": "um/m"}))
    assert recording.reference_link_mm is not None
    np.testing.assert_allclose(recording.reference_link_mm[:, 0], np.arange(9.0) / 1e3)


def test_um_stays_as_it_was(tmp_path: Path) -> None:
    columns = pointing("mm")
    reference = {"quantity": "tool_position", "unit": "um", "frame": "machine", "sigma_um": 0.5}
    recording = read_recording(write_external(tmp_path, columns, reference))
    assert recording.unit == "um"
    assert recording.reference_mm is not None
    np.testing.assert_array_equal(recording.reference_mm[:, 0], columns["reference_x_mm"])


@pytest.mark.parametrize(
    ("reference", "expected"),
    [
        ({"unit": "furlong"}, ["reference.unit: is unknown", "um, arcsec, deg, mrad, urad, um/m"]),
        ({"unit": 7}, ["reference.unit: is unknown"]),
        ({"unit": "arcsec", "sigma_um": 1.5}, ["contradicts the unit arcsec", "write `sigma:`"]),
        ({"unit": "arcsec", "sigma": -1}, ["is no standard uncertainty", "in arcsec"]),
        ({"unit": "arcsec", "sigma": [1, 1, 1]}, ["sigma has 3 values for 2 reference columns"]),
        ({"unit": "arcsec", "frame": "instrument"}, ["only lengths have a frame to be fitted"]),
        ({"unit": "arcsec", "quantity": "tool_pose"}, ["of tool_pose is um"]),
    ],
)
def test_what_does_not_go_together_is_refused(tmp_path: Path, reference: dict[str, Any], expected: list[str]) -> None:
    message = problems_of(tmp_path, pointing(), {"quantity": "tool_position", **reference})
    assert all(text in message for text in expected)


def test_sigma_of_a_reference_in_um_is_sigma_um(tmp_path: Path) -> None:
    message = problems_of(tmp_path, pointing("mm"), {"quantity": "tool_position", "frame": "machine", "sigma": 1.5})
    assert "contradicts the unit um" in message
    assert "sigma_um" in message


def test_columns_in_another_unit_than_the_sidecar_says_are_one_problem(tmp_path: Path) -> None:
    message = problems_of(tmp_path, pointing(), {"quantity": "tool_position", "frame": "machine"})
    assert "in arcsec by their names, but the reference is in um by the sidecar" in message
    assert "write `unit: arcsec`" in message
    assert message.count("next:") == 1


def test_columns_in_mm_beside_another_unit_are_refused(tmp_path: Path) -> None:
    message = problems_of(tmp_path, pointing("mm"), ARCSEC)
    assert "in mm by their names, but the reference is in arcsec" in message


def test_a_machine_that_compd_knows_is_measured_in_um(tmp_path: Path) -> None:
    path = record(tmp_path, gauges(30, 1), reference={"quantity": "tool_position", "unit": "arcsec"})
    with pytest.raises(RecordingError, match="belongs to `machine: external`"):
        read_recording(path)


def test_merged_recordings_keep_unit_and_folds(tmp_path: Path) -> None:
    columns = {**pointing(), "azimuth_deg": np.arange(40.0)}
    paths = [write_external(tmp_path, columns, ARCSEC, "azimuth_deg", name) for name in ("one", "two")]
    merge_recordings([read_recording(path) for path in paths], tmp_path / "both.csv")
    both = read_recording(tmp_path / "both.csv")
    assert (both.unit, both.sidecar.folds, both.rows) == ("arcsec", ("azimuth_deg",), 80)
    np.testing.assert_allclose(both.reference_sigma_mm, 1.5e-3)
    other = write_external(tmp_path, columns, ARCSEC, "place", "three")
    with pytest.raises(RecordingError, match="has other folds"):
        merge_recordings([read_recording(paths[0]), read_recording(other)], tmp_path / "more.csv")
