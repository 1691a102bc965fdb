"""Configurations, recordings with their sidecars, model files: read, or refused with every problem."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from compd.configuration import load
from compd.errors import CompdError, ConfigurationError, RecordingError
from compd.model.library import load_effects
from compd.model_file import read_model_file
from compd.recording import convert_recording, read_recording, read_sample
from tests.fuzz.bounds import examples, is_told, refusal
from tests.fuzz.mutations import ALIASES, BOMBS, changed_binary, changed_bytes
from tests.support.live_models import file_with
from tests.support.paths import CONFIG
from tests.support.recordings import SIDECAR, csv_text

SHIPPED = [path.read_text() for path in sorted(CONFIG.glob("*.yaml"))]
EFFECTS = [path.read_text() for path in sorted((CONFIG / "effects").glob("*.yaml"))]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("files")


@pytest.fixture(scope="module")
def model_text(folder: Path) -> str:
    return file_with(folder / "whole.yaml", "link_zero", "tool_offset").read_text()


@pytest.mark.parametrize("bomb", [*BOMBS, ALIASES], ids=lambda bomb: repr(bomb[:20]))
def test_a_file_that_breaks_parsers_is_no_configuration(folder: Path, bomb: str) -> None:
    path = folder / "bomb.yaml"
    path.write_bytes(bomb.encode("utf-8", "surrogateescape"))
    with pytest.raises(ConfigurationError) as refused:
        load(path)
    assert is_told(refused.value)
    assert len(str(refused.value)) < 20_000


@pytest.mark.long
@pytest.mark.sample
@given(content=changed_bytes(SHIPPED))
@examples(150)
def test_a_changed_configuration_is_one_or_is_refused(folder: Path, content: bytes) -> None:
    path = folder / "machine.yaml"
    path.write_bytes(content)
    assert is_told(refusal(lambda: load(path), ConfigurationError))


@pytest.mark.long
@pytest.mark.sample
@given(table=changed_bytes([csv_text()]), sidecar=st.just(SIDECAR.encode()) | changed_bytes([SIDECAR]))
@examples(150)
def test_a_changed_recording_is_one_or_is_refused(folder: Path, table: bytes, sidecar: bytes) -> None:
    path = folder / "run.csv"
    path.write_bytes(table)
    path.with_suffix(".yaml").write_bytes(sidecar)
    assert is_told(refusal(lambda: read_recording(path), RecordingError, ConfigurationError))


@pytest.mark.long
@given(data=st.data())
@examples(100)
def test_a_changed_parquet_file_is_a_recording_or_is_refused(folder: Path, data: st.DataObject) -> None:
    (folder / "whole.yaml").write_text(SIDECAR)
    (folder / "whole.csv").write_text(csv_text())
    path = folder / "binary.parquet"
    if not path.exists():
        convert_recording(folder / "whole.csv", path)
    changed = folder / "changed.parquet"
    changed.with_suffix(".yaml").write_text(SIDECAR)
    changed.write_bytes(data.draw(changed_binary(path.read_bytes())))
    assert is_told(refusal(lambda: read_recording(changed), RecordingError))
    assert is_told(refusal(lambda: read_sample(changed, None, 7, 12), RecordingError))


@pytest.mark.long
@pytest.mark.sample
@given(data=st.data())
@examples(150)
def test_a_changed_model_file_is_one_or_is_refused(folder: Path, model_text: str, data: st.DataObject) -> None:
    path = folder / "model.yaml"
    path.write_bytes(data.draw(changed_bytes([model_text])))
    assert is_told(refusal(lambda: read_model_file(path, "tripod-cmm", 3), CompdError))


@given(content=changed_bytes(EFFECTS))
@examples(100)
def test_a_changed_file_of_effects_is_one_or_is_refused(folder: Path, content: bytes) -> None:
    path = folder / "effects.yaml"
    path.write_bytes(content)
    assert is_told(refusal(lambda: load_effects(path), CompdError))
