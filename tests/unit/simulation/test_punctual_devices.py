"""The simulated machine is as punctual as the daemon: its threads have real-time priority, where that is permitted."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from compd.simulation.wires.server import Simulation
from tests.support.command import run_in_process
from tests.support.paths import CONFIG


@pytest.mark.parametrize("name", ["tripod-cmm.yaml", "hexapod.yaml"])
def test_priority_is_asked_for_before_the_lines_have_threads(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[int, int]] = []
    began: list[int] = []
    monkeypatch.setattr(
        os, "sched_setscheduler", lambda _, policy, parameters: asked.append((policy, parameters.sched_priority))
    )
    monkeypatch.setattr("signal.signal", lambda *_: None)
    start = Simulation.start

    def started(simulation: Simulation) -> object:
        began.append(len(asked))
        return start(simulation)

    monkeypatch.setattr(Simulation, "start", started)
    run_in_process("sim", "run", str(CONFIG / name), "--directory", str(tmp_path), "--seconds", "0")
    assert asked == [(os.SCHED_FIFO, 5)], "below acquisition's 10 and the loop's 40"
    assert began == [1]
