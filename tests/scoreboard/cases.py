"""The cases of the scoreboard: hidden causes, sizes of their errors, machines."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from compd.simulation.causes.catalogue import CAUSES, shuffle_causes

Kind = Literal["library", "nothing", "outside", "pair"]
KINDS: tuple[Kind, ...] = ("library", "nothing", "outside", "pair")
# Sizes of the tip's error in units of the reference's noise.
STRENGTHS = (0.5, 1.0, 2.0, 4.0)
SEEDS = 5
NOTHING = 100
OUTSIDE = 10
PAIRS = 40
# Range of sizes for causes outside the library and for pairs.
FLOORS = (2.0, 6.0)


@dataclass(frozen=True)
class Case:
    """One campaign. causes: ids; floors: the size of each one's error over the noise; seed: of machine and days."""

    kind: Kind
    causes: tuple[str, ...]
    floors: tuple[float, ...]
    seed: int

    @property
    def name(self) -> str:
        """Key in the file of results."""
        hidden = "+".join(f"{cause}x{size:.2g}" for cause, size in zip(self.causes, self.floors, strict=True))
        return f"{self.kind}:{hidden or '-'}:{self.seed}"


def cases(
    kinds: Sequence[Kind], strengths: Sequence[float], seeds: int, nothing: int, outside: int, pairs: int
) -> list[Case]:
    """All cases, in an order in which the first part of a run contains some of every kind."""
    library = [name for name, cause in CAUSES.items() if cause.in_library]
    others = [name for name, cause in CAUSES.items() if not cause.in_library]
    by_kind = {
        "library": [
            Case("library", (name,), (floors,), 1000 + seed)
            for seed in range(seeds)
            for floors in strengths
            for name in library
        ],
        "nothing": [Case("nothing", (), (), 2000 + seed) for seed in range(nothing)],
        "outside": [
            Case("outside", (name,), (_size(3000 + seed),), 3000 + seed) for seed in range(outside) for name in others
        ],
        "pair": [_pair(library, 4000 + seed) for seed in range(pairs)],
    }
    return list(_evenly([by_kind[kind] for kind in kinds]))


def _size(seed: int) -> float:
    return round(float(np.random.default_rng(seed).uniform(*FLOORS)), 2)


def _pair(library: Sequence[str], seed: int) -> Case:
    first, second, *_ = shuffle_causes(library, seed, "pair")
    sizes = np.round(np.random.default_rng(seed).uniform(*FLOORS, 2), 2).tolist()
    return Case("pair", (first, second), (sizes[0], sizes[1]), seed)


def _evenly(groups: Sequence[Sequence[Case]]) -> Iterator[Case]:
    """Merge the groups, each spread evenly over the whole."""
    placed = [((number + 0.5) / len(group), case) for group in groups for number, case in enumerate(group)]
    return (case for _, case in sorted(placed, key=lambda pair: pair[0]))


def parse_cases(texts: Sequence[str]) -> list[Case]:
    """Cases from names as `Case.name` writes them. Raises ValueError for an unknown kind."""
    parsed = []
    for text in texts:
        kind, hidden, seed = text.split(":")
        known = next((known for known in KINDS if known == kind), None)
        if known is None:
            raise ValueError(f"{text}: kind is one of {', '.join(KINDS)}")
        parts = [] if hidden == "-" else [part.rpartition("x") for part in hidden.split("+")]
        causes, floors = tuple(part[0] for part in parts), tuple(float(part[2]) for part in parts)
        parsed.append(Case(known, causes, floors, int(seed)))
    return parsed
