"""A scale that has lost its count while nobody read it, on real ports: the daemon, or its acquisition, starts anew."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator

import pytest

from compd.setpoint_states import State
from tests.injection import faults
from tests.injection.rig import InjectedMachine
from tests.injection.trial import BACK_WITHIN_S, settle
from tests.support.patience import PATIENCE_S
from tests.support.process_checks import is_ok, started_again, starts
from tests.support.simulated import run_directory
from tests.support.watching import Seen, until

# At rest a valid setpoint is nearer to the truth.
NOISE_UM = 10.0


@pytest.fixture(scope="module")
def injected() -> Iterator[InjectedMachine]:
    with run_directory() as directory, InjectedMachine(directory) as machine:
        yield machine


def _lose_5_mm(machine: InjectedMachine) -> None:
    machine.injector.fault("scale_1", faults.Off(("position",), -5.0))


def _restarted(machine: InjectedMachine, lose: Callable[[InjectedMachine], None]) -> None:
    machine.daemon.stop()
    lose(machine)
    machine.daemon.__enter__()


def _killed(machine: InjectedMachine, lose: Callable[[InjectedMachine], None]) -> None:
    before = starts(machine.daemon, "acquisition")
    machine.signal("acquisition", signal.SIGKILL)
    lose(machine)
    until("a new process", lambda: started_again(machine.daemon, "acquisition", before))


@pytest.mark.long
@pytest.mark.parametrize(
    "gap", [pytest.param(_killed, marks=pytest.mark.sample, id="killed"), pytest.param(_restarted, id="restarted")]
)
def test_a_scale_that_has_lost_its_count_meanwhile_waits_for_a_person(
    injected: InjectedMachine, gap: Callable[..., None]
) -> None:
    settle(injected)
    gap(injected, _lose_5_mm)
    with injected.watched() as watcher:
        until("a fault", lambda: any(seen["state"] == State.FAULT for seen in watcher.seen), PATIENCE_S)
        assert "waits for a person" in watcher.seen[-1]["reason"]
        with injected.daemon.connected() as client:
            assert "scale_1" in client.status()["waits_for_person"]
        verdict = injected.judge(watcher.seen)
        assert verdict.judged == 0 or verdict.worst_um < NOISE_UM, verdict.worst
        injected.injector.repair()
        injected.accept()
        assert injected.until_ok(watcher, BACK_WITHIN_S)
        assert injected.judge(watcher.seen).worst_um < NOISE_UM


@pytest.mark.long
@pytest.mark.parametrize("gap", [pytest.param(_killed, id="killed"), pytest.param(_restarted, id="restarted")])
def test_where_no_gauge_has_changed_nobody_is_asked(injected: InjectedMachine, gap: Callable[..., None]) -> None:
    settle(injected)
    for _ in range(3):
        gap(injected, lambda machine: None)
        with injected.watched() as watcher:
            watcher.until("ok from new readings", _read_since(time.monotonic()), 0)
            assert injected.judge(watcher.seen).worst_um < NOISE_UM


def _read_since(begin_s: float) -> Callable[[Seen], bool]:
    return lambda seen: is_ok(seen) and seen["time_s"] - seen["age_s"] > begin_s
