"""Files that release 0.2.0 wrote are read: configurations, machine zeros, model files, recordings and their cycles.

files-0.2/: made by the code of 0.2.0. `compd sim campaign --seed 3 --effect link_expansion`, every sixteenth row of it;
`compd model add link_expansion` on the whole; 8 cycles of a day of each machine, from the 4th on with that model.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from compd.cli.measurements.recording.replay import replay as replay_command
from compd.comparison import open_recording
from compd.configuration import load
from compd.live.machine import load_zero
from compd.live.record import RecordedCycles, differing_cells, replay_cycles
from compd.live.system import THIS_COMPUTER
from compd.machine_builder import build_model
from compd.model_file import read_model_file
from tests.support.live_machine import Machine

FILES = Path(__file__).parent / "files-0.2"
LINKS = {"tripod-cmm": 3, "hexapod": 6}


@pytest.mark.parametrize("machine", LINKS)
def test_its_configurations_and_machine_zeros_belong_together(machine):
    live = Machine(load(FILES / f"{machine}.yaml"))
    # their frame comparators and thermometers state no range, of which no release before this one warned
    assert all("no range is stated" in warning.what for warning in live.configuration.warnings)
    assert build_model(live.configuration.geometry, live.configuration.wiring).links == LINKS[machine]
    zero = load_zero(
        FILES / f"{machine}-zero.d", live.configuration.zero_hash, live.wires.length_channels, THIS_COMPUTER
    )
    assert zero.readings_mm == dict.fromkeys(live.wires.length_channels, 12.5)


@pytest.mark.parametrize("machine", LINKS)
def test_its_model_files_are_read(machine):
    (path,) = FILES.glob(f"{machine}-run-*.model-*.yaml")
    (fitted,) = read_model_file(path, machine, LINKS[machine]).fitted
    assert fitted.effect.id == "link_expansion"
    assert 0.6 < float(fitted.theta[0]) < 0.8


@pytest.mark.parametrize("name", ["campaign", "tripod-cmm-run-0001", "hexapod-run-0001"])
def test_its_recordings_are_read(name):
    if name == "campaign":
        aligned = open_recording(FILES / "campaign.csv")
        assert (aligned.recording.rows, aligned.recording.sidecar.format) == (39, 2)
    else:
        assert list(differing_cells(RecordedCycles(FILES / name))) == []


@pytest.mark.parametrize("machine", LINKS)
def test_its_cycles_replay(machine, capsys):
    configuration = load(FILES / f"{machine}.yaml")
    cycles = list(replay_cycles(configuration, RecordedCycles(FILES / f"{machine}-run")))
    assert len(cycles) == 8
    assert [cycle.where for cycle in cycles if cycle.differs] == []
    assert {cycle.computed_by for cycle in cycles} == {"compd 0.2.0, kernels not recorded"}
    replay_command(FILES / f"{machine}-run", FILES / f"{machine}.yaml")
    assert "8 cycles replayed; every setpoint is the one that was sent" in capsys.readouterr().err
