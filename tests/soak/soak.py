"""Simulated shop time with faults from the whole matrix: at random places, and now and then two at once."""

from __future__ import annotations

import random
import time
from collections.abc import Callable, Sequence
from typing import Any

from compd.errors import DaemonError
from tests.injection.case import Case, Way
from tests.injection.cases_of_signals import SIGNALS
from tests.injection.cells.verdict import judge
from tests.injection.matrix import MATRIX
from tests.injection.rig import InjectedMachine
from tests.injection.trial import BACK_WITHIN_S, accept
from tests.injection.truth import SETTLED_S
from tests.soak.resources import resources_by_process
from tests.soak.summary import Summary
from tests.support.pauses import MATTERS_S, Pauses
from tests.support.watching import Watcher

# How often two faults come together, and how often none does.
TOGETHER_SHARE = 0.2
QUIET_SHARE = 0.1
# Stroke in which the machine visits places, mm; every link goes some way, since one that stays while all others go is
# taken for stuck.
STROKE_MM = 12.0
MIN_WAY_MM = 0.2
# A fault lasts between these times, s.
LASTS_S = (0.5, 4.0)
# How long a fault's end is given before a person accepts all gauges, and then before the daemon is started anew.
BY_ITSELF_S = 4.0
AFTER_ACCEPTANCE_S = 10.0
# Memory is compared with what it is after so many episodes: by then everything has been used once.
WARM_EPISODES = 5

Say = Callable[[str], None]


def soak(
    machine: InjectedMachine, minutes: float, seed: int, say: Say, together_share: float = TOGETHER_SHARE
) -> Summary:
    """Run it. The faults, their order and places follow from the seed; their times are those of the computer."""
    chance = random.Random(seed)
    summary = Summary(seed)
    pauses = Pauses()
    start_s = told_s = time.monotonic()
    episode = 0
    place_mm = [0.0] * 3
    with pauses.watched():
        while time.monotonic() < start_s + 60 * minutes:
            if episode == WARM_EPISODES:
                summary.before = resources_by_process(machine.daemon.pids())
            cases = _drawn(chance, together_share)
            place_mm = [_other_mm(length_mm, chance) for length_mm in place_mm]
            _episode(machine, cases, place_mm, chance.uniform(*LASTS_S), summary, pauses)
            episode += 1
            if time.monotonic() > told_s + 60:
                told_s = time.monotonic()
                say(f"{(told_s - start_s) / 60:.0f} min: {episode} episodes, {sum(summary.states.values())} setpoints")
    machine.repair()
    machine.truth.rest_for(1.0)
    summary.after = resources_by_process(machine.daemon.pids())
    summary.seconds = time.monotonic() - start_s
    return summary


# Without the one that nothing shows and that costs millimetres: what happens beside it could not be judged.
DRAWN = [case for case in (*MATRIX, *SIGNALS) if case.at_least_um < 1000.0]


def _drawn(chance: random.Random, together_share: float) -> list[Case]:
    """No fault, one, or two that leave the daemon alive."""
    if chance.random() < QUIET_SHARE:
        return []
    one = chance.choice(DRAWN)
    if one.lost or chance.random() > together_share:
        return [one]
    return [one, chance.choice([case for case in DRAWN if not case.lost and case.id != one.id])]


def _other_mm(length_mm: float, chance: random.Random) -> float:
    while abs((other_mm := chance.uniform(-STROKE_MM, STROKE_MM)) - length_mm) < MIN_WAY_MM:
        pass
    return other_mm


def _episode(
    machine: InjectedMachine,
    cases: Sequence[Case],
    place_mm: Sequence[float],
    lasts_s: float,
    summary: Summary,
    pauses: Pauses,
) -> None:
    """To a place, the faults for `lasts_s`, and out of them again."""
    machine.truth.forget()
    before = _counts(machine)
    paused_before_s = pauses.lost_s
    with machine.watched() as watcher:
        machine.truth.drive(place_mm)
        arrived = watcher.now  # that a machine leaves after a rest, no bound says
        for case in cases:
            case.begin(machine)
        machine.truth.rest_for(lasts_s)
        machine.repair()
        if not watcher.ended:
            machine.truth.rest_for(SETTLED_S)  # a fault's end is a jump, too, and shows at the next poll
        accepted = restarted = False
        doubts = ""
        if not watcher.ended and not _settles(machine, watcher, BY_ITSELF_S):
            doubts = watcher.seen[-1]["reason"]
            accepted = accept(machine)
            restarted = not _settles(machine, watcher, AFTER_ACCEPTANCE_S)
        verdict = machine.judge(watcher.seen)
        bounds = judge(machine.truth, watcher.seen[arrived:])
        ended = bool(watcher.ended)
        summary.broken += [f"{[case.id for case in cases]}: {broken}" for broken in watcher.broken[:1]]
    fault = summary.add(cases, verdict)
    if not any(case.unseen for case in cases):
        summary.beyond += [f"{[case.id for case in cases]}: {problem}" for problem in bounds.problems]
    fault.accepted += accepted
    if doubts and not any(_explains(case, doubts) for case in cases):
        paused_s = pauses.lost_s - paused_before_s
        alarm = f"{[case.id for case in cases]}: {doubts} (the computer itself paused for {paused_s:.2f} s)"
        (summary.alarms_in_pauses if paused_s >= MATTERS_S else summary.false_alarms).append(alarm)
    fault.restarted += restarted
    if ended and not any(case.lost for case in cases):
        summary.broken.append(f"{[case.id for case in cases]}: the connection ended")
    if restarted:
        machine.restart(forget=True)
    elif not ended:
        after = _counts(machine)
        summary.cycles += max(0, after["cycles"] - before["cycles"])
        summary.missed += max(0, after["missed_cycles"] - before["missed_cycles"])
    if restarted or ended:
        with machine.watched() as again:
            if not _settles(machine, again, BACK_WITHIN_S):
                # gauges are written once a second: of one that has moved since, a person is asked
                if "came back" not in (why := again.seen[-1]["reason"]) and not any(_explains(c, why) for c in cases):
                    summary.false_alarms.append(f"{[case.id for case in cases]}: after the restart: {why}")
                fault.accepted += accept(machine)
                assert machine.until_ok(again), again.seen[-1].setpoint


def _explains(case: Case, doubts: str) -> bool:
    """Whether the fault is one that a person has to end, or the gauge is named that it is at."""
    return case.way is not Way.UNDISTURBED and (case.way is not Way.UNSEEN or case.names in doubts)


def _settles(machine: InjectedMachine, watcher: Watcher, patience_s: float) -> bool:
    try:
        return machine.until_ok(watcher, patience_s)
    except DaemonError:
        return False


def _counts(machine: InjectedMachine) -> dict[str, Any]:
    counts: dict[str, Any] = machine.daemon.status()["loop"]
    return counts
