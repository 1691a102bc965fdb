"""Setpoints of a cell held against the truth and against the bound that each of them states."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from compd.setpoint_states import Mode
from tests.injection.truth import Truth
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
    """What was published in a cell.

    held : valid setpoints whose true tip is known. beyond : of them, in error by more than their bound. unbounded :
    of them, without a bound. worst_um, worst_bound_um : the largest error, and the bound of that setpoint. most :
    largest error over its bound. bound_um : median. error_95_um : of the errors. late : valid setpoints whose target
    is older than `TARGET_LATE_S`. target_late_s : age of the oldest target of a valid setpoint, by its id.
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
    states: dict[str, int] = field(default_factory=dict)
    reasons: list[str] = field(default_factory=list)

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
        if self.late > BEYOND_SHARE * self.setpoints:
            oldest = f"{self.target_late_s:.2f} s"
            problems.append(f"{self.late} of {self.setpoints} setpoints answer an old target, up to {oldest}")
        return problems


def judge(truth: Truth, seen: Sequence[Seen]) -> Verdict:
    """Ask for the truth once more first: the last ones are held against it."""
    truth.rest_for(0.0)
    valid = [one.setpoint for one in seen if one["valid"]]
    states = Counter(str(one["state"]) for one in seen)
    reasons = Counter(str(one["reason"]) for one in seen if one["reason"])
    verdict = Verdict(len(seen), len(valid), states=dict(states), reasons=[r[:200] for r, _ in reasons.most_common(3)])
    ages_s = list(_target_ages_s(valid))
    verdict.target_late_s = max(ages_s, default=math.nan)
    verdict.late = sum(age_s > TARGET_LATE_S for age_s in ages_s)
    if valid:
        _hold(verdict, valid, truth.tips_mm([setpoint["time_s"] for setpoint in valid]))
    return verdict


def _hold(verdict: Verdict, valid: Sequence[Message], true_mm: Any) -> None:
    known = np.isfinite(true_mm[:, 0])
    tips_mm = np.array([setpoint["tip_M_mm"] for setpoint in valid], dtype=float)
    errors_um = np.linalg.norm(tips_mm - true_mm, axis=1)[known] * 1e3
    errors_um[~np.isfinite(errors_um)] = math.inf
    bounds_um = np.array([tip_bound_um(setpoint) for setpoint in valid])[known]
    verdict.held = len(errors_um)
    if not verdict.held:
        return
    bounded = np.isfinite(bounds_um)
    verdict.unbounded = int(np.sum(~bounded))
    verdict.beyond = int(np.sum(errors_um > bounds_um))
    worst = int(np.argmax(errors_um))
    verdict.worst_um, verdict.worst_bound_um = float(errors_um[worst]), float(bounds_um[worst])
    verdict.error_95_um = float(np.quantile(errors_um, 0.95, method="higher"))
    if bounded.any():
        verdict.most = float(np.max(errors_um[bounded] / bounds_um[bounded]))
        verdict.bound_um = float(np.median(bounds_um[bounded]))


def _target_ages_s(valid: Sequence[Message]) -> Iterator[float]:
    """Of the controllers of `clients`, whose ids are the times of their targets, us."""
    for setpoint in valid:
        if setpoint["mode"] == Mode.MACHINE_TOOL and "target_id" in setpoint:
            yield setpoint["time_s"] - setpoint["target_id"] / 1e6
