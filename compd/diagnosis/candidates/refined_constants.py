"""Values of nonlinear constants between those of an effect's grid, near one that was chosen."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from compd.comparison import AlignedRecording, neighbouring_periods
from compd.diagnosis.candidate_criteria import CandidateCriteria
from compd.diagnosis.candidates.candidates import Candidate, variant


def refined_variants(
    candidates: Sequence[Candidate],
    members: Iterable[int],
    aligned: AlignedRecording,
    criteria: CandidateCriteria = CandidateCriteria(),
) -> list[Candidate]:
    """For each member of a set, its effect at constants between the chosen one and its neighbours among all candidates.

    members : places of candidates.  Choices, and constants that the machine's description gives, have nothing between.
    A period that was found in the residual is known to a quarter of a turn over the rows, and is refined within that:
    little noise tells it far better.
    """
    refined: list[Candidate] = []
    for k in members:
        chosen = candidates[k]
        if chosen.kind != "effect":
            continue
        for constant in chosen.effect.constants:
            value = chosen.constants[constant.name]
            described = {constants[constant.name] for constants in chosen.effect.constant_grid(aligned.rows)} == {value}
            if constant.choice or described:
                continue
            others = {name: v for name, v in chosen.constants.items() if name != constant.name}
            grid = {
                candidate.constants[constant.name]
                for candidate in candidates
                if candidate.kind == "effect"
                and candidate.name == chosen.name
                and all(candidate.constants[name] == v for name, v in others.items())
            }
            if constant.period_of:
                grid.update(neighbouring_periods(chosen.effect, constant, aligned, value))
            refined += [
                variant(chosen.effect, {**others, constant.name: new}, aligned, chosen.searched_parameters)
                for new in _between(sorted(grid), value, criteria.constants_between)
            ]
    return refined


def _between(grid: Sequence[float], value: float, count: int) -> list[float]:
    """So many values between one of a rising grid and each of its neighbours."""
    index = grid.index(value)
    ends = [grid[other] for other in (index - 1, index + 1) if 0 <= other < len(grid)]
    space = np.geomspace if grid[0] > 0 else np.linspace
    return [float(new) for end in ends for new in space(value, end, count + 2)[1:-1]]
