"""Setpoints of a cell held against the truth and against the bound that each of them states."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from statistics import median

from compd.setpoint_states import Mode
from tests.injection.machine import Held, Machine
from tests.support.watching import Message, Seen

# Of the cycles of a cell so many may have a setpoint beyond its bound, which is one of 95 %; none beyond twice.
BEYOND_SHARE, BEYOND_MOST = 0.05, 2.0
# A target that was made so long before is old: longer than the time between the bursts of `clients`.
TARGET_LATE_S = 0.5


def tip_bound_um(setpoint: Message) -> float:
    """The 95 % bound of the tip's error that a setpoint states; nan where it states none."""
    return float(setpoint.get("u_tip_um", math.nan))


@dataclass
class Verdict:
    """What was published while a fault lasted.

    held : valid setpoints whose true tip is known. beyond : of them, in error by more than their bound. unbounded :
    of them, without a bound. worst_um, worst_bound_um : the largest error, and the bound of that setpoint. most :
    largest error over its bound. worst_at_rest_um, worst : the largest error at rest, and that setpoint. bound_um :
    median. error_95_um : of the errors. late : valid setpoints whose target is older than `TARGET_LATE_S`.
    target_late_s : age of the oldest target of a valid setpoint, by its id. longest_reason : in bytes.
    """

    setpoints: int = 0
    valid: int = 0
    held: int = 0
    beyond: int = 0
    unbounded: int = 0
    worst_um: float = math.nan
    worst_bound_um: float = math.nan
    most: float = math.nan
    bound_um: float = math.nan
    error_95_um: float = math.nan
    late: int = 0
    target_late_s: float = math.nan
    worst_at_rest_um: float = math.nan
    worst: Message = field(default_factory=dict)
    longest_reason: int = 0
    states: dict[str, int] = field(default_factory=dict)
    reasons: list[str] = field(default_factory=list)

    @property
    def old_targets(self) -> list[str]:
        """What is wrong where too many setpoints answer an old target."""
        if self.late <= BEYOND_SHARE * self.setpoints:
            return []
        return [f"{self.late} of {self.setpoints} setpoints answer an old target, up to {self.target_late_s:.2f} s"]

    @property
    def problems(self) -> list[str]:
        """What must not be, but for a fault that nothing shows."""
        problems = []
        if self.beyond > BEYOND_SHARE * self.setpoints:
            problems.append(f"{self.beyond} of {self.setpoints} setpoints are valid and wrong by more than their bound")
        if self.most > BEYOND_MOST:
            problems.append(
                f"a valid setpoint is wrong by {self.most:.1f} times its bound; worst {self.worst_um:.1f} um"
            )
        if self.unbounded:
            problems.append(
                f"{self.unbounded} of {self.held} valid setpoints have no bound; worst {self.worst_um:.1f} um"
            )
        return problems + self.old_targets


def judge(machine: Machine, seen: Sequence[Seen]) -> Verdict:
    """Hold setpoints against the truth, once they have all come."""
    machine.rest_for(0.0)
    right = [one for one in seen if one["valid"]]
    valid = [one.setpoint for one in right]
    states = Counter(str(one["state"]) for one in seen)
    reasons = Counter(str(one["reason"]) for one in seen if one["reason"])
    verdict = Verdict(len(seen), len(valid), states=dict(states), reasons=[r[:300] for r, _ in reasons.most_common(5)])
    verdict.longest_reason = max((len(reason.encode()) for reason in reasons), default=0)
    ages_s = list(_target_ages_s(valid))
    verdict.target_late_s = max(ages_s, default=math.nan)
    verdict.late = sum(age_s > TARGET_LATE_S for age_s in ages_s)
    _hold(verdict, list(zip(machine.hold(right), valid, strict=True)))
    return verdict


def _hold(verdict: Verdict, held: Sequence[tuple[Held, Message]]) -> None:
    # a tip that is no number is as wrong as can be
    known = [
        (math.inf if math.isnan(one.error_um) else one.error_um, one.rested, setpoint)
        for one, setpoint in held
        if one.error_um is not None
    ]
    verdict.held = len(known)
    if not known:
        return
    rests = [(error_um, setpoint) for error_um, rested, setpoint in known if rested]
    if rests:
        verdict.worst_at_rest_um, verdict.worst = max(rests, key=lambda one: one[0])
    errors_um = [error_um for error_um, _, _ in known]
    bounds_um = [tip_bound_um(setpoint) for _, _, setpoint in known]
    shares = [error_um / bound_um for error_um, bound_um in zip(errors_um, bounds_um, strict=True)]
    verdict.unbounded = sum(map(math.isnan, bounds_um))
    verdict.beyond = sum(share > 1.0 for share in shares)
    verdict.worst_um, verdict.worst_bound_um = max(zip(errors_um, bounds_um, strict=True), key=lambda one: one[0])
    verdict.error_95_um = sorted(errors_um)[math.ceil(0.95 * len(errors_um)) - 1]
    if bounded := [share for share in shares if not math.isnan(share)]:
        verdict.most = max(bounded)
        verdict.bound_um = median(bound_um for bound_um in bounds_um if not math.isnan(bound_um))


def _target_ages_s(valid: Sequence[Message]) -> Iterator[float]:
    """Of the controllers of `clients`, whose ids are the times of their targets, us."""
    for setpoint in valid:
        if setpoint["mode"] == Mode.MACHINE_TOOL and "target_id" in setpoint:
            yield setpoint["time_s"] - setpoint["target_id"] / 1e6
