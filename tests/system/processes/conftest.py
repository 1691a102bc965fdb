"""The daemons that these tests share."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.support.daemon_process import Daemon
from tests.support.process_checks import PAUSES
from tests.support.processes import Machine


@pytest.fixture(scope="package")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Machine]:
    with Machine(tmp_path_factory.mktemp("processes")) as machine:
        yield machine


@pytest.fixture
def apart(machine: Machine) -> Daemon:
    """The misbehaving gauge's line has a process of its own."""
    return machine.daemon(machine.configuration("apart"))


@pytest.fixture
def together(machine: Machine) -> Daemon:
    """The misbehaving gauge's line shares the acquisition process with the others."""
    return machine.daemon(machine.configuration("together", own_process=()))


@pytest.fixture
def fresh(machine: Machine) -> Daemon:
    """A daemon that the test may end."""
    return machine.daemon(machine.configuration("apart"), fresh=True)


@pytest.fixture
def changing(machine: Machine) -> Daemon:
    """A daemon whose configuration the test may change."""
    return machine.daemon(machine.configuration("changing"), fresh=True)


@pytest.fixture(autouse=True)
def pauses() -> Iterator[None]:
    """The computer's own pauses are known."""
    with PAUSES.watched():
        yield
