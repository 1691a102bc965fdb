"""Exports written by hand, read or refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from compd.errors import RecordingError
from compd.instruments.export import InstrumentExport, ReadOptions
from compd.instruments.read import read_export


def read(directory: Path, content: str | bytes, **said: Any) -> InstrumentExport:
    """What a file with this content holds, when a person has said so much."""
    path = directory / "export.txt"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_export(path, ReadOptions(**said))


def refused(directory: Path, content: str | bytes, **said: Any) -> str:
    """Why a file with this content is refused."""
    with pytest.raises(RecordingError) as caught:
        read(directory, content, **said)
    assert all("export.txt" in problem.where for problem in caught.value.problems)
    return str(caught.value)
