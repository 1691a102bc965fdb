"""What tests of the daemon's processes ask of a daemon and of the setpoints that were seen."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from compd.setpoint_states import State
from tests.support.daemon_process import Daemon
from tests.support.pauses import Pauses
from tests.support.watching import Seen

# What may be missed or disturbed beside a misdeed: a share of the cycles, and one pause of a computer that has other
# work. A driver that keeps the loop's interpreter costs nine cycles in ten.
MISSED_SHARE = 0.02
PAUSE_S = 0.1
# Setpoints that are not ok: polls have no priority, and a simulated gauge on a busy computer answers late.
DISTURBED_SHARE = 0.2
PAUSES = Pauses()


def allowance(cycles: float, rate_hz: float) -> float:
    """How many of these cycles a loaded computer may cost, and one that itself paused."""
    return MISSED_SHARE * cycles + (PAUSE_S + 1.2 * PAUSES.lost_s) * rate_hz


@contextmanager
def cycles_kept(daemon: Daemon) -> Iterator[None]:
    """The loop misses no more cycles in the block than any computer may cost it."""
    before = daemon.status()["loop"]
    yield
    after = daemon.status()["loop"]
    cycles, missed = (after[key] - before[key] for key in ("cycles", "missed_cycles"))
    print(f"{missed} of {cycles + missed} cycles missed")
    assert cycles > 0
    assert missed <= allowance(cycles + missed, daemon.rate_hz)


def check_undisturbed(daemon: Daemon, seen: list[Seen]) -> None:
    """Setpoints are ok, except for as many as a busy computer may cost."""
    disturbed = [s for s in seen if not is_ok(s)]
    print(f"{len(disturbed)} of {len(seen)} setpoints not ok")
    assert len(disturbed) <= DISTURBED_SHARE * len(seen) + allowance(0, daemon.rate_hz), disturbed[0].setpoint


def starts(daemon: Daemon, process: str) -> int:
    return int(daemon.processes()[process]["starts"])


def started_again(daemon: Daemon, process: str, before: int) -> dict[str, Any] | None:
    """What STATUS says of a process once it has been started more than `before` times."""
    entry = daemon.processes()[process]
    return entry if entry["starts"] > before else None


def is_valid(seen: Seen) -> bool:
    return bool(seen["valid"])


def is_ok(seen: Seen) -> bool:
    return bool(seen["state"] == State.OK)


def correction_mm(seen: Seen) -> np.ndarray:
    return np.array(seen["correction_mm"])
