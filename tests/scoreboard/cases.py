"""What is tried: which causes are hidden, how large they make the tip's error, on which machine."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from compd.simulation.causes.catalogue import CAUSES

Kind = Literal["library", "nothing", "outside", "pair"]
KINDS: tuple[Kind, ...] = ("library", "nothing", "outside", "pair")
# Times the reference's noise, per coordinate. The acceptance counts one to six.
STRENGTHS = (0.5, 1.0, 2.0, 4.0)
SEEDS = 5
NOTHING = 100
OUTSIDE = 10
PAIRS = 40
# Causes outside the library and pairs: from plain to strong.
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
        """Its key in the file of results; the diagnosis never sees it."""
        hidden = "+".join(f"{one}x{size:.2g}" for one, size in zip(self.causes, self.floors, strict=True))
        return f"{self.kind}:{hidden or '-'}:{self.seed}"


def cases(
    kinds: Sequence[Kind], strengths: Sequence[float], seeds: int, nothing: int, outside: int, pairs: int
) -> list[Case]:
    """All of them, in an order in which a run that is cut short has seen a bit of everything."""
    library = [name for name, cause in CAUSES.items() if cause.in_library]
    others = [name for name, cause in CAUSES.items() if not cause.in_library]
    found = {
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
    return list(_evenly([found[kind] for kind in kinds]))


def _size(seed: int) -> float:
    return round(float(np.random.default_rng(seed).uniform(*FLOORS)), 2)


def _pair(library: Sequence[str], seed: int) -> Case:
    rng = np.random.default_rng(seed)
    first, second = rng.choice(library, 2, replace=False).tolist()
    sizes = np.round(rng.uniform(*FLOORS, 2), 2).tolist()
    return Case("pair", (first, second), (sizes[0], sizes[1]), seed)


def _evenly(groups: Sequence[Sequence[Case]]) -> Iterator[Case]:
    """Each group spread over the whole: sorted by how far through its own group a case is."""
    placed = [((number + 0.5) / len(group), case) for group in groups for number, case in enumerate(group)]
    return (case for _, case in sorted(placed, key=lambda pair: pair[0]))


def named(texts: Sequence[str]) -> list[Case]:
    """From names as `Case.name` writes them; to run single cases again. Raises ValueError for another kind."""
    found = []
    for text in texts:
        kind, hidden, seed = text.split(":")
        matched = next((one for one in KINDS if one == kind), None)
        if matched is None:
            raise ValueError(f"{text}: kind is one of {', '.join(KINDS)}")
        parts = [] if hidden == "-" else [part.rpartition("x") for part in hidden.split("+")]
        found.append(Case(matched, tuple(p[0] for p in parts), tuple(float(p[2]) for p in parts), int(seed)))
    return found
