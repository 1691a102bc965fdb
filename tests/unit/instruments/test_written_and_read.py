"""What is written in the shape of an instrument is read again: the same numbers, times and names."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from compd.instruments.axes import LENGTH_AXES, POSITION_AXES
from compd.instruments.export import ReadOptions
from compd.instruments.formats import instrument_formats, written_forms
from compd.instruments.read import read_export
from compd.instruments.samples import Samples
from tests.support.instrument_files import write_export

RATE_HZ = 8.0
COUNT = 50
START = datetime(2026, 11, 22, 23, 59, 57)


def samples(axes: tuple[str, ...] = ("x", "y", "z"), **more: Any) -> Samples:
    rng = np.random.default_rng(4)
    return Samples(axes, rng.uniform(-900, 900, (COUNT, len(axes))), **more)


@pytest.mark.parametrize("unit", ["mm", "inch"])
@pytest.mark.parametrize("shape", written_forms())
def test_a_track_is_read_again(tmp_path: Path, shape: str, unit: str) -> None:
    form = written_forms()[shape]
    axes = POSITION_AXES if POSITION_AXES in form.axes else LENGTH_AXES
    written = samples(axes, time_s=np.arange(COUNT) / RATE_HZ, start=START)
    path = write_export(tmp_path, shape, written, unit)
    said: dict[str, Any] = ({} if form.says_rate else {"rate_hz": RATE_HZ}) | ({} if form.says_unit else {"unit": unit})
    export = read_export(path, ReadOptions(**said))
    assert form in instrument_formats()[export.shape].written
    assert export.axes == axes
    np.testing.assert_allclose(export.values, written.values, atol=max(2e-4, form.resolution_mm))
    assert export.time_s is not None
    coarse_s = 0.2 if shape == "sa" else 1e-3
    np.testing.assert_allclose(export.time_s - export.time_s[0], np.arange(COUNT) / RATE_HZ, atol=coarse_s)
    assert (export.time_std_s > 0.2) == (shape == "sa")


@pytest.mark.parametrize(
    "shape", [name for name, form in written_forms().items() if form.holds_points and form.says_unit]
)
def test_points_are_read_again(tmp_path: Path, shape: str) -> None:
    written = samples(names=[f"P{k % 20:03d}" for k in range(COUNT)])
    export = read_export(write_export(tmp_path, shape, written), ReadOptions())
    assert export.name == tuple(written.names or ())
    assert export.time_s is None
    np.testing.assert_allclose(export.values, written.values, atol=max(2e-4, written_forms()[shape].resolution_mm))
