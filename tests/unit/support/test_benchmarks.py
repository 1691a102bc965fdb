"""Every benchmark begins, and ends by itself."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
from contextlib import contextmanager

import pytest

from tests.benchmarks import limits
from tests.benchmarks.bench_loop import configuration
from tests.benchmarks.cost_table import ROOT
from tests.benchmarks.limits import first_good, limit, printed_lines
from tests.support.patience import PATIENCE_S

# Together they take 25 s of processor time; each of the others takes more, or compiles kernels.
SHORT = ("exports", "flood", "gateway", "kilohertz", "kinematics", "latency", "worlds")
EVERY = sorted(path.stem.removeprefix("bench_") for path in (ROOT / "tests" / "benchmarks").glob("bench_*.py"))
NEEDS = {"kilohertz": "cyclictest", "kinematics": "gcc", "layouts": "cyclictest", "workbench": "chromium"}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in SHORT else pytest.mark.long) for name in EVERY]
)
@pytest.mark.timeout(900)
def test_a_benchmark_of_the_smallest_size_ends(name):
    if shutil.which(NEEDS.get(name, sys.executable)) is None:
        pytest.skip(f"{NEEDS[name]} is not installed")
    command = [sys.executable, "-m", f"tests.benchmarks.bench_{name}", "--smallest"]
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout


def test_machine_zero_of_the_benchmarks_has_every_quantity(tmp_path):
    settings = configuration(tmp_path, 200)
    content = json.loads(next((tmp_path / "state").glob("*zero*")).read_text(encoding="utf-8"))
    assert content["quantities"].keys() == {quantity.name for quantity in settings.wiring.quantities}


class NoZero:
    """A daemon that says at once that it has no machine zero, and nothing after that."""

    def watch(self):
        yield {"state": "no_zero", "reason": "bring the machine to its zero position"}
        signal.pause()


def test_a_daemon_without_good_setpoints_ends_the_benchmark_with_its_reason(monkeypatch):
    @contextmanager
    def connect(socket):
        yield NoZero()

    monkeypatch.setattr(limits, "connect", connect)
    with pytest.raises(SystemExit, match=r"cannot begin.*no_zero: bring the machine to its zero position"):
        first_good("/no/socket", within_s=0.05)


def test_a_client_that_ends_before_its_time_ends_the_benchmark_with_a_sentence():
    client = subprocess.Popen([sys.executable, "-c", "print(1)"], stdout=subprocess.PIPE, text=True)
    with client, pytest.raises(SystemExit, match="after 1 of 3 setpoints"):
        printed_lines(client, 3)


def test_a_limit_leaves_the_limit_around_it():
    with limit(PATIENCE_S, lambda: "the outer one"):
        with pytest.raises(SystemExit, match="the inner one"), limit(0.01, lambda: "the inner one"):
            signal.pause()
        assert 0.0 < signal.getitimer(signal.ITIMER_REAL)[0] <= PATIENCE_S
        with pytest.raises(SystemExit, match="the outer one"):
            signal.raise_signal(signal.SIGALRM)
