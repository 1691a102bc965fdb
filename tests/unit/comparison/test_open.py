"""Opening recordings and models without the command line."""

from __future__ import annotations

from pathlib import Path

import pytest

from compd.comparison.open import open_recording
from compd.errors import RecordingError
from tests.support.measured import gauges, record, tripod


def test_the_shipped_machine_is_found_by_its_name(tmp_path: Path) -> None:
    aligned = open_recording(record(tmp_path, gauges(20, 1)))
    assert aligned.model is not None
    assert aligned.recording.rows == 20
    assert aligned.geometry_hash == tripod().geometry_hash


@pytest.mark.parametrize("name", ["my-machine", "../tripod-cmm"])
def test_an_unknown_machine_is_refused_with_the_next_step(tmp_path: Path, name: str) -> None:
    path = record(tmp_path, gauges(20, 1))
    sidecar = path.with_suffix(".yaml")
    sidecar.write_text(sidecar.read_text(encoding="utf-8").replace("tripod-cmm", name), encoding="utf-8")
    with pytest.raises(RecordingError, match="comes with compd") as error:
        open_recording(path)
    assert "--machine" in str(error.value)
