"""Files that release 0.1.0 wrote, or that people wrote for it, are read; of them only machine zero names a format."""

from __future__ import annotations

from pathlib import Path

import pytest

from compd.comparison import open_recording
from compd.configuration import load
from compd.live.machine import load_zero
from compd.live.system import THIS_COMPUTER
from compd.machine_builder import build_model
from compd.model_file import read_model_file
from tests.support.live_machine import Machine

FILES = Path(__file__).parent / "files"
REPLAY = Path(__file__).parent / "replay"
LINKS = {"tripod-cmm": 3, "hexapod": 6}


@pytest.mark.parametrize("machine", LINKS)
def test_its_configurations_are_machines(machine: str) -> None:
    configuration = load(FILES / f"{machine}.yaml")
    # their frame comparators and thermometers state no range, of which no release before this one warned
    assert all("no range is stated" in warning.what for warning in configuration.warnings)
    assert build_model(configuration.geometry, configuration.wiring).links == LINKS[machine]


def test_its_machine_zero_is_still_that_of_its_configuration() -> None:
    live = Machine(load(FILES / "tripod-cmm.yaml"))
    zero = load_zero(FILES / "zero.d", live.configuration.zero_hash, live.wires.length_channels, THIS_COMPUTER)
    assert zero.readings_mm == dict.fromkeys(live.wires.length_channels, 12.5)


def test_its_recordings_are_compared() -> None:
    aligned = open_recording(FILES / "campaign.csv")
    assert aligned.recording.rows == 39
    assert aligned.recording.sidecar.format == 1


@pytest.mark.parametrize("path", sorted(REPLAY.glob("*.model-*.yaml")), ids=lambda path: path.stem)
def test_its_model_files_are_read(path: Path) -> None:
    machine = next(name for name in LINKS if path.name.startswith(name))
    assert read_model_file(path, machine, LINKS[machine]).fitted
