"""How often the true error is within the bound of a setpoint, and how wide the bound is: counts that never grow."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from scipy.stats import beta

CONFIDENCE = 0.95
# Bounds are counted in classes of this ratio, from this bound (um) on.
_RATIO, _LEAST_UM = 1.05, 1e-3
NO_FAULT = "none"


class Case(NamedTuple):
    """What a setpoint is counted under.

    state : "rest", "motion", "after" (a fault is present, or ended 5 s ago) or "departure" (the machine has left, and
    no reading shows it yet).
    """

    state: str
    family: str


class Share(NamedTuple):
    """Setpoints beyond their bound.

    stretches : stretches of time without a change of the case. upper : limit of the share beyond, with `CONFIDENCE`.
    """

    setpoints: int
    beyond: int
    stretches: int
    upper: float


class Coverage:
    """Counts of one or of several worlds; `add` sums them up."""

    def __init__(self) -> None:
        self.all: Counter[Case] = Counter()
        self.valid: Counter[Case] = Counter()
        self.bounded: Counter[Case] = Counter()
        self.beyond: Counter[Case] = Counter()
        self.stretches: Counter[Case] = Counter()
        self.widths: Counter[int] = Counter()
        self._before: frozenset[Case] = frozenset()

    def count(self, cases: Iterable[Case], valid: bool, error_um: float, bound_um: float) -> None:
        """Count one setpoint. error_um, bound_um : nan where it is not known."""
        now = frozenset(cases)
        self.all.update(now)
        self.stretches.update(now - self._before)
        self._before = now
        if not valid:
            return
        self.valid.update(now)
        if math.isnan(bound_um) or math.isnan(error_um):
            return
        self.bounded.update(now)
        self.widths[_class(bound_um)] += 1
        if error_um > bound_um:
            self.beyond.update(now)

    def add(self, other: Coverage) -> None:
        for name, counts in vars(other).items():
            if isinstance(counts, Counter):
                getattr(self, name).update(counts)

    def share(self, case: Case) -> Share:
        """Setpoints of one case beyond their bound."""
        n, k, stretches = self.bounded[case], self.beyond[case], self.stretches[case]
        return Share(n, k, stretches, upper_limit(k, n, stretches))

    def shares(self) -> Iterator[tuple[Case, Share]]:
        for case in sorted(self.all):
            yield case, self.share(case)

    def width_um(self, quantile: float) -> float:
        """Quantile of the bound over all valid setpoints, um; nan without any."""
        wanted, seen = quantile * self.widths.total(), 0
        for of_class in sorted(self.widths):
            seen += self.widths[of_class]
            if seen >= wanted:
                return float(_LEAST_UM * _RATIO**of_class)
        return math.nan


def upper_limit(k: int, n: int, trials: int) -> float:
    """Upper limit (Clopper-Pearson) of a share of which `k` of `n` were seen; 1 without any.

    trials : independent ones among the n. Setpoints of one stretch share their cause, so a stretch is one trial.
    """
    trials = min(n, trials)
    if not trials:
        return 1.0
    seen = k / n * trials
    return 1.0 if seen >= trials else float(beta.ppf(CONFIDENCE, seen + 1, trials - seen))


def _class(bound_um: float) -> int:
    return math.ceil(math.log(max(bound_um, _LEAST_UM) / _LEAST_UM) / math.log(_RATIO))
