"""One simulated machine at a time in a directory, and nothing of it for the next one."""

from __future__ import annotations

import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from compd.errors import CompdError
from compd.simulation.wires.simulation_directory import WRITTEN_BY, SimulationDirectory
from tests.support.patience import PATIENCE_S
from tests.support.sampled import sampled
from tests.support.simulated import TRIPOD, run_directory

NAME = "tripod-cmm.yaml"


@pytest.fixture
def directory() -> Iterator[Path]:
    with run_directory() as path:
        yield path


def what_a_killed_simulator_leaves(directory: Path) -> None:
    (directory / NAME).write_text(f"# {WRITTEN_BY}\n")
    for folder in ("ports", "state"):
        (directory / folder).mkdir()
    (directory / "ports" / "scale_1").symlink_to("/dev/pts/nothing")
    for name in ("machine-zero.json", "machine-zero.json.old", ".machine-zero.json.1234", "last-readings.json"):
        (directory / "state" / name).write_text("{}")
    (directory / "hidden.answer.json").write_text("{}")
    for name in ("control.sock", "compd.sock"):
        with socket.socket(socket.AF_UNIX) as listener:
            listener.bind(str(directory / name))


@contextmanager
def listening(path: Path) -> Iterator[None]:
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(path))
        listener.listen()
        yield


def test_what_a_killed_simulator_left_is_gone_before_the_next_machine_starts(directory: Path) -> None:
    what_a_killed_simulator_leaves(directory)
    own = SimulationDirectory(directory, NAME)
    own.begin()
    assert list(directory.iterdir()) == []
    own.end()


def test_at_the_end_all_is_gone_but_the_sealed_answer_and_what_others_put_there(directory: Path) -> None:
    own = SimulationDirectory(directory, NAME)
    own.begin()
    what_a_killed_simulator_leaves(directory)
    (directory / "state" / "notes.txt").write_text("mine")
    (directory / "ports" / "notes.txt").write_text("mine")
    own.end()
    left = sorted(str(path.relative_to(directory)) for path in directory.rglob("*") if path.is_file())
    assert left == ["hidden.answer.json", "ports/notes.txt", "state/notes.txt"]


def test_a_second_simulator_is_refused_and_takes_nothing_from_the_first(directory: Path) -> None:
    first = SimulationDirectory(directory, NAME)
    first.begin()
    what_a_killed_simulator_leaves(directory)
    with pytest.raises(CompdError, match="another simulator runs in this directory"):
        SimulationDirectory(directory, NAME).begin()
    assert (directory / "ports" / "scale_1").is_symlink()
    first.end()
    third = SimulationDirectory(directory, NAME)
    third.begin()
    third.end()


def test_a_daemon_of_the_machine_before_is_told_to_be_ended(directory: Path) -> None:
    with listening(directory / "compd.sock"), pytest.raises(CompdError, match="a daemon still runs"):
        SimulationDirectory(directory, NAME).begin()
    own = SimulationDirectory(directory, NAME)
    own.begin()
    own.end()


def test_the_socket_of_a_daemon_that_still_runs_stays(directory: Path) -> None:
    own = SimulationDirectory(directory, NAME)
    own.begin()
    with listening(directory / "compd.sock"):
        own.end()
        assert (directory / "compd.sock").exists()


def test_a_configuration_that_no_simulator_wrote_is_not_replaced(directory: Path) -> None:
    (directory / NAME).write_text("machine: mine\n")
    with pytest.raises(CompdError, match="was not written by `compd sim run`"):
        SimulationDirectory(directory, NAME).begin()
    assert (directory / NAME).read_text() == "machine: mine\n"


@pytest.mark.parametrize("end", sampled([signal.SIGINT, signal.SIGTERM, signal.SIGHUP], 3))
def test_the_command_leaves_nothing_however_it_is_ended(directory: Path, end: signal.Signals) -> None:
    command = [sys.executable, "-m", "compd", "sim", "run", str(TRIPOD), "--directory", str(directory)]
    heeded = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    finally:
        signal.signal(signal.SIGINT, heeded)
    with process:
        assert process.stdout is not None
        assert any("Ctrl-C ends" in line for line in process.stdout)
        assert (directory / NAME).exists()
        process.send_signal(end)
        assert process.wait(PATIENCE_S) == 0
    assert list(directory.iterdir()) == []
