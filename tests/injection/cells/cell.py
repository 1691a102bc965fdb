"""The cells: faults in a situation."""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import dataclass

from tests.injection.case import Case
from tests.injection.cases_of_numbers import STUCK
from tests.injection.cells.situation import Situation
from tests.injection.matrix import VIRTUAL

PAIRS, PAIRS_SEED = 150, 36
NO_FAULT = "no-fault"


@dataclass(frozen=True)
class Cell:
    """No fault, one, or two at once, in a situation."""

    cases: tuple[Case, ...]
    situation: Situation

    @property
    def name(self) -> str:
        faults = "+".join(case.id for case in self.cases) or NO_FAULT
        return f"{faults}@{self.situation.name.lower()}"

    @property
    def unseen(self) -> bool:
        """Whether nothing shows one of its faults, or not at once.

        Where the daemon was away, a fault that repeats what another has made wrong repeats it before anything else has
        been read.
        """
        restarted_pair = self.situation is Situation.RESTART and len(self.cases) > 1
        return any(case.unseen for case in self.cases) or (
            restarted_pair and any(case.group == STUCK for case in self.cases)
        )

    @property
    def expands(self) -> bool:
        """Whether it needs a machine that expands."""
        return any(case.expands for case in self.cases)

    @property
    def drives_itself(self) -> bool:
        return any(case.drives for case in self.cases)

    @property
    def watched_s(self) -> float:
        """How long the faults last."""
        return max((case.watched_s for case in self.cases), default=WITHOUT_FAULT_S)


# Long enough for the noise of some hundred polls.
WITHOUT_FAULT_S = 10.0


def all_cells(pairs: int = PAIRS, seed: int = PAIRS_SEED) -> list[Cell]:
    """Every situation without a fault and with each, then the pairs."""
    single: list[tuple[Case, ...]] = [(), *((case,) for case in VIRTUAL)]
    cells = [Cell(cases, s) for cases in single for s in Situation if all(s.fits(case) for case in cases)]
    return [*cells, *_pairs(pairs, random.Random(seed))]


def _pairs(count: int, chance: random.Random) -> Iterator[Cell]:
    """Two faults that can be seen, and a situation that fits both; no pair twice."""
    candidates = [case for case in VIRTUAL if not (case.unseen or case.lost or case.drives)]
    drawn: set[str] = set()
    while len(drawn) < count:
        cases = tuple(chance.sample(candidates, 2))
        cell = Cell(cases, chance.choice([s for s in Situation if all(s.fits(case) for case in cases)]))
        name = "+".join(sorted(case.id for case in cases))
        if name not in drawn and not cell.unseen:
            drawn.add(name)
            yield cell
