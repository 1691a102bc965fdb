"""A client that sees every setpoint and holds each to the rules, and waiting for what comes."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from compd.client import connect
from compd.clock import MonotonicClock
from compd.errors import DaemonError
from compd.setpoint_states import State, state_named
from tests.support.patience import PATIENCE_S

LOOK_EVERY_S = 0.05
# Numbers are rounded to 1e-7 mm.
ROUNDING_MM = 1e-6

Message = dict[str, Any]
T = TypeVar("T")


def until(what: str, holds: Callable[[], T | None], patience_s: float = PATIENCE_S) -> T:
    """The first true value of `holds`; fails when none comes."""
    clock, never, end_s = MonotonicClock(), threading.Event(), time.monotonic() + patience_s
    while not (value := holds()):
        assert time.monotonic() < end_s, f"never: {what}"
        clock.wait(never, LOOK_EVERY_S)
    return value


class Rules(NamedTuple):
    """What a configuration promises of every setpoint."""

    period_s: float
    slew_mm_per_s: float
    stale_after_s: float
    hold_s: float


def broken_rules(setpoint: Message, before: Message | None, last_valid: Message | None, rules: Rules) -> Iterator[str]:
    """What is wrong with a setpoint, after the one before it and the last one that was valid."""
    if before is not None and not (setpoint["seq"] > before["seq"] and setpoint["time_s"] > before["time_s"]):
        yield f"seq or time does not grow: {before['seq']}, {before['time_s']} s"
    state = state_named(setpoint["state"])
    if state is None or state.valid != setpoint["valid"]:
        yield "validity is not that of its state"
    if setpoint["state"] != State.OK and not setpoint["reason"]:
        yield "no reason"
    if not setpoint["valid"]:
        if numbers := {"tip_M_mm", "scale_setpoint_mm", "correction_mm", "link_length_mm"} & setpoint.keys():
            yield f"invalid, with {sorted(numbers)}"
        return
    replaced = state in (State.HOLD, State.FADE)
    if setpoint["age_s"] > rules.stale_after_s + (rules.hold_s if replaced else 0.0) + 1e-3:
        yield f"from readings that are {setpoint['age_s']} s old"
    if last_valid is not None:
        step_mm = np.abs(np.subtract(setpoint["correction_mm"], last_valid["correction_mm"])).max()
        # a correction slews by periods, whatever the jitter of their times
        elapsed_s = max(
            setpoint["time_s"] - last_valid["time_s"], (setpoint["seq"] - last_valid["seq"]) * rules.period_s
        )
        if step_mm > rules.slew_mm_per_s * elapsed_s + ROUNDING_MM:
            yield f"the correction jumps by {step_mm} mm in {elapsed_s} s"


@dataclass(frozen=True)
class Seen:
    """A setpoint, and when it arrived."""

    arrived_s: float
    setpoint: Message

    def __getitem__(self, key: str) -> Any:
        return self.setpoint[key]


class Watcher:
    """A client that takes every setpoint, on a thread of its own, and holds each to the rules.

    Attributes
    ----------
    seen : all that arrived. ended : why no more come; "" while they do. broken : which setpoint broke which rule.
    """

    def __init__(self, address: Path, rules: Rules, rate_hz: float | None = None) -> None:
        self.seen: list[Seen] = []
        self.ended = ""
        self.broken: list[str] = []
        self._rules = rules
        self._end = threading.Event()
        self._rate_hz = rate_hz
        self._client = connect(address, PATIENCE_S)
        self._thread = threading.Thread(target=self._run, name="watcher", daemon=True)
        self._thread.start()

    @property
    def now(self) -> int:
        """What is seen from this index on is new."""
        return len(self.seen)

    def until(self, what: str, holds: Callable[[Seen], bool], since: int = 0) -> Seen:
        """The first setpoint from index `since` on for which `holds`; fails when none comes, or no more can."""
        end_s = time.monotonic() + PATIENCE_S
        index = since
        while True:
            ended, patient = self._end.is_set(), time.monotonic() < end_s
            for seen in self.seen[index:]:
                if holds(seen):
                    return seen
                index += 1
            last = self.seen[-1].setpoint if self.seen else None
            assert not ended, f"never: {what}; {self.ended}; last {last}"
            assert patient, f"never: {what}; still {last}"
            # not one by one: at 1 kHz that would take the interpreter from the thread that reads
            self._end.wait(LOOK_EVERY_S)

    def for_s(self, duration_s: float) -> list[Seen]:
        """What arrives from now on, until the daemon's clock is `duration_s` further."""
        since = self.now
        first = self.until("a setpoint", lambda _: True, since)
        self.until(f"{duration_s} s more", lambda seen: seen["time_s"] - first["time_s"] >= duration_s, since)
        return self.seen[since:]

    def until_end(self) -> None:
        """Wait until the daemon has closed the connection."""
        assert self._end.wait(PATIENCE_S), "setpoints still come"

    def close(self) -> None:
        """Stop watching."""
        # ends the thread's read; the thread closes the files
        self._client._connection.shutdown()
        self._thread.join(PATIENCE_S)
        assert not self._thread.is_alive()

    def _run(self) -> None:
        before = last_valid = None
        why = "stopped watching"
        try:
            for setpoint in self._client.watch(self._rate_hz):
                broken = [f"{rule}: {setpoint}" for rule in broken_rules(setpoint, before, last_valid, self._rules)]
                before, last_valid = setpoint, setpoint if setpoint["valid"] else last_valid
                self.seen.append(Seen(time.monotonic(), setpoint))
                self.broken += broken
        except DaemonError as error:
            why = str(error)
        finally:
            self._client.close()
            self.ended = why
            self._end.set()
