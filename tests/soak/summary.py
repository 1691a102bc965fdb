"""What a soak has seen, added up, and what of it must not be."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from tests.injection.case import Case
from tests.injection.rig import Verdict
from tests.soak.resources import Resources


@dataclass
class FaultCount:
    """What became of one fault, or of several at once. bound_um : of them together."""

    bound_um: float
    count: int = 0
    worst_um: float = math.nan
    worst: dict[str, Any] = field(default_factory=dict)
    accepted: int = 0
    restarted: int = 0


@dataclass
class Summary:
    """All episodes of a soak.

    broken : rules of setpoints. beyond : setpoints that are wrong by more than their bound.
    false_alarms : reasons for which a person had to accept a gauge that had no fault.
    alarms_in_pauses : such reasons where the computer itself paused: the simulated gauges did not answer meanwhile.
    """

    seed: int
    faults: dict[str, FaultCount] = field(default_factory=dict)
    states: Counter[str] = field(default_factory=Counter)
    judged: int = 0
    valid: int = 0
    seconds: float = 0.0
    cycles: int = 0
    missed: int = 0
    broken: list[str] = field(default_factory=list)
    beyond: list[str] = field(default_factory=list)
    false_alarms: list[str] = field(default_factory=list)
    alarms_in_pauses: list[str] = field(default_factory=list)
    before: dict[str, Resources] = field(default_factory=dict)
    after: dict[str, Resources] = field(default_factory=dict)

    def add(self, cases: Sequence[Case], verdict: Verdict) -> FaultCount:
        """An episode with these faults at once; none for a pause between two."""
        name = " + ".join(sorted(case.id for case in cases)) or "no fault"
        bound_um = sum(case.bound_um for case in cases) or 1.0
        fault = self.faults.setdefault(name, FaultCount(bound_um))
        fault.count += 1
        if not math.isnan(verdict.worst_um) and not verdict.worst_um <= fault.worst_um:
            fault.worst_um, fault.worst = verdict.worst_um, verdict.worst
        self.states += verdict.states
        self.judged += verdict.judged
        self.valid += verdict.valid
        return fault

    def problems(self) -> list[str]:
        """What must not be."""
        wrong = [
            f"{name}: a valid setpoint is wrong by {fault.worst_um:.1f} um, allowed {fault.bound_um:g}: {fault.worst}"
            for name, fault in self.faults.items()
            if fault.worst_um > fault.bound_um
        ]
        stuck = [
            f"{name}: ok again only after a restart, {fault.restarted} of {fault.count} times"
            for name, fault in self.faults.items()
            if fault.restarted
        ]
        grown = [
            f"{name}: {growth}"
            for name, resources in self.after.items()
            if name in self.before and (growth := resources.growth_since(self.before[name]))
        ]
        return [
            *wrong,
            *stuck,
            *grown,
            *self.broken,
            *self.beyond,
            *(f"false alarm: {alarm}" for alarm in self.false_alarms),
        ]

    def text(self, unseen: Sequence[str]) -> str:
        """For people. unseen : ids of the faults that nothing shows; their errors are told apart."""
        total = sum(self.states.values())
        lines = [
            f"soak of {self.seconds / 60:.1f} minutes, seed {self.seed}",
            f"{sum(fault.count for fault in self.faults.values())} episodes, {total} setpoints, {self.valid} valid, "
            f"{self.judged} held against the true tip",
            f"{self.missed} of {self.cycles + self.missed} cycles missed",
            "",
            f"{'fault':58} {'times':>5} {'worst valid':>12} {'bound':>8} {'accepted':>9}",
        ]
        worst_first = sorted(self.faults.items(), key=lambda item: -_or_zero(item[1].worst_um))
        lines += [
            f"{name[:58]:58} {fault.count:5} {fault.worst_um:9.2f} um {fault.bound_um:5g} um {fault.accepted:9}"
            for name, fault in worst_first
        ]
        hidden = [item for item in worst_first if set(item[0].split(" + ")) & set(unseen)]
        shown = [item for item in worst_first if item not in hidden]
        for label, found in (("that something shows", shown), ("that nothing shows", hidden)):
            if found:
                name, fault = found[0]
                lines.append(f"largest error of a valid setpoint, faults {label}: {fault.worst_um:.2f} um ({name})")
        lines += ["", f"{'process':14} {'memory, MB':>16} {'threads':>9} {'descriptors':>12}"]
        for name, after in self.after.items():
            before = self.before.get(name, after)
            lines.append(
                f"{name:14} {before.memory_mb:6.0f} to {after.memory_mb:5.0f} {before.threads:4} to {after.threads}"
                f" {before.descriptors:6} to {after.descriptors}"
            )
        lines += ["", *(f"does not count: {alarm}" for alarm in self.alarms_in_pauses)]
        return "\n".join(lines)


def unseen_ids(cases: Sequence[Case]) -> list[str]:
    return [case.id for case in cases if case.unseen]


def _or_zero(number: float) -> float:
    return 0.0 if math.isnan(number) else number
