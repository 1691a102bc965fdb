"""A recording is whole, whatever ends beside it, and where the disk has no room it ends with a sentence."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from compd.configuration import load
from compd.live.record.recording_part import RecordingPart
from tests.support.paths import CONFIG
from tests.worlds.clients import Recording
from tests.worlds.faults import begin
from tests.worlds.faults.computer import killed
from tests.worlds.recorded import recorded
from tests.worlds.world import LOOP, SERVICE, World, built


def record(world: World, name: Path) -> Recording:
    machine = name.with_name("machine.yaml")
    machine.write_text(world.configuration.path.read_text())
    return world.clients.record(name, load(machine))


@pytest.mark.parametrize("machine", ["tripod-cmm.yaml", pytest.param("hexapod.yaml", marks=pytest.mark.long)])
def test_a_recording_is_whole_where_processes_are_killed(machine: str, tmp_path: Path) -> None:
    with built(CONFIG / machine, 21) as world:
        recording = record(world, tmp_path / "run")
        begin(world, "persons", "adopt", "", {"model": "link_zero", "um": 60.0, "shadow": False})
        for process in (LOOP, SERVICE, "acquisition"):
            world.run(0.7)
            killed(world, process)
        world.run(3.0)
        recording.end()
        world.run(1.0)
        assert recorded(recording, world.configuration) == ""
        assert not recording.failure
        assert len(recording.received) > 200
        assert not world.died


def test_a_full_disk_ends_a_recording_with_a_sentence(tmp_path: Path) -> None:
    with built(CONFIG / "tripod-cmm.yaml", 22) as world:
        recording = record(world, tmp_path / "run")
        world.run(1.7)
        begin(world, "computer", "disk_full", "", {"lasts_s": 2.0})
        world.run(1.5)
        assert "cannot be written to: No space left on device" in recording.failure
        assert "what was written before is whole" in recording.failure
        assert recorded(recording, world.configuration) == ""
        assert "rows came and are not on the disk" in recording.summary
        assert not world.died


def test_a_row_that_is_not_written_is_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    add = RecordingPart.add
    calls: list[bytes] = []

    def forgetful(part: RecordingPart, line: bytes, message: dict[str, Any]) -> None:
        calls.append(line)
        if len(calls) != 7:
            add(part, line, message)

    monkeypatch.setattr(RecordingPart, "add", forgetful)
    with built(CONFIG / "tripod-cmm.yaml", 23) as world:
        recording = record(world, tmp_path / "run")
        world.run(0.6)
        recording.end()
        world.run(1.0)
        assert "lost cycles" in recorded(recording, world.configuration)
