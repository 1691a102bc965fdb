"""Values of nonlinear constants between those of an effect's grid, near one that was chosen."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from compd.comparison.aligned_recording import AlignedRecording
from compd.diagnosis.candidates.candidates import Candidate, variant

# Values between neighbours that are tried: a grid of time constants a factor of two apart becomes one of 1.15.
BETWEEN = 4


def refined_variants(
    candidates: Sequence[Candidate], members: Iterable[int], aligned: AlignedRecording
) -> list[Candidate]:
    """For each member of a set, its effect at constants between the chosen one and its neighbours among all candidates.

    members : places of candidates.  Choices, and constants that the machine's description gives, have nothing between.
    """
    refined: list[Candidate] = []
    for k in members:
        chosen = candidates[k]
        if chosen.kind != "effect":
            continue
        for constant in chosen.effect.constants:
            if constant.choice or constant.period_of:
                continue  # the spectrum of a period is as fine as the rows can tell
            value = chosen.constants[constant.name]
            others = {name: v for name, v in chosen.constants.items() if name != constant.name}
            grid = sorted(
                {
                    candidate.constants[constant.name]
                    for candidate in candidates
                    if candidate.kind == "effect"
                    and candidate.name == chosen.name
                    and all(candidate.constants[name] == v for name, v in others.items())
                }
            )
            refined += [
                variant(chosen.effect, {**others, constant.name: new}, aligned, chosen.searched_parameters)
                for new in _between(grid, value)
            ]
    return refined


def _between(grid: Sequence[float], value: float) -> list[float]:
    """Values between one of a rising grid and its neighbours."""
    place = grid.index(value)
    ends = [grid[other] for other in (place - 1, place + 1) if 0 <= other < len(grid)]
    space = np.geomspace if grid[0] > 0 else np.linspace
    return [float(new) for end in ends for new in space(value, end, BETWEEN + 2)[1:-1]]
