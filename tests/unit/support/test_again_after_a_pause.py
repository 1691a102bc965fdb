"""A test that fails while the computer itself paused is tried again, with every machine that it shares set up anew."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from tests.support.paths import ROOT
from tests.support.patience import PATIENCE_S

CONFTEST = """
from contextlib import nullcontext

import pytest
import tests.conftest as again
from tests.conftest import *


class Paused:
    lost_s = 0.0
    settled = 0
    watched = staticmethod(nullcontext)

    def settle(self):
        self.settled += 1


again._PAUSES = Paused()


@pytest.fixture
def paused():
    return again._PAUSES


@pytest.fixture(scope="module")
def machine(made=[]):
    made.append("machine")
    return len(made)
"""
TESTS = """
def test_shares_the_machine(machine):
    assert machine == 1

def test_fails_once_in_a_pause(machine, paused):
    if machine == 1:
        paused.lost_s += 0.2
        raise AssertionError("the gauge was lost")

def test_fails_without_a_pause(machine, paused):
    assert machine == 3, machine

def test_fails_in_every_pause(paused):
    assert paused.settled in (1, 2, 3, 4), "between two tries the computer comes to rest"
    paused.lost_s += 0.2
    raise AssertionError("it is wrong")
"""


@pytest.mark.long
def test_only_in_a_pause_and_four_times_at_most(tmp_path):
    (tmp_path / "conftest.py").write_text(CONFTEST)
    (tmp_path / "test_gauges.py").write_text(TESTS)
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-o", "timeout=100", "-v", str(tmp_path)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    ran = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False, timeout=PATIENCE_S
    )
    said = ran.stdout
    assert "test_fails_once_in_a_pause PAUSED" in said, said + ran.stderr
    assert said.count("PAUSED") == 1 + 3
    assert "FAILED test_gauges.py::test_fails_without_a_pause - AssertionError: 2" in said
    assert "FAILED test_gauges.py::test_fails_in_every_pause" in said
    assert "tried again: test_gauges.py::test_fails_once_in_a_pause: the computer itself paused for 0.20 s" in said
    assert "2 failed, 2 passed, 4 tried again" in said
