"""Which of an effect's numbers these rows cannot tell apart, and what they look like together."""

from __future__ import annotations

import numpy as np

from compd.arrays import FloatArray
from compd.diagnosis.candidates.candidates import Candidate
from compd.diagnosis.search.problem import DiagnosisProblem
from compd.diagnosis.search.subset_losses import SubsetLosses
from compd.text import join_words

# Numbers of a combination that are named: those with so large a share of its largest.
_NAMED_SHARE = 0.3
MAX_NAMED = 6
# Cosine from which two motions of the rows are said to be alike.
_ALIKE = 0.95


def undetermined_text(problem: DiagnosisProblem, losses: SubsetLosses, member: int) -> str:
    """What the least certain combination of an effect's numbers does on these rows, in words.

    The combination is that of the largest variance, each number measured by the width of its plausible range: the
    direction of the smallest singular value of the scaled Jacobian.
    """
    candidate = losses.candidates[member]
    _, covariance = losses.estimates([member])[0]
    width = np.ptp(candidate.limits, axis=1)
    if not (np.isfinite(width).all() and np.isfinite(covariance).all()):
        return ""
    _, directions = np.linalg.eigh(covariance / np.outer(width, width))
    share = directions[:, -1]
    names = [column.name for column in candidate.effect.columns(problem.aligned.rows.links)]
    named = [
        name for name, part in zip(names, np.abs(share), strict=True) if part >= _NAMED_SHARE * np.abs(share).max()
    ]
    who = join_words(named) if len(named) <= MAX_NAMED else f"{named[0]} to {named[-1]}"
    together = " together act" if len(named) > 1 else " acts"
    rows = problem.whiten(candidate.columns_um)
    moved = rows.reshape(-1, rows.shape[2]) @ (share * width)
    like = _like(problem, losses, candidate, moved)
    if like:
        return f"{who}{together} like {like}"
    move = "together move" if len(named) > 1 else "moves"
    return f"{who} {move} these rows too little to be told from the error that is left"


def _like(problem: DiagnosisProblem, losses: SubsetLosses, candidate: Candidate, moved: FloatArray) -> str:
    """What else moves the rows as `moved` does: what is fitted along, or a number of another effect; "" for nothing."""
    nuisance = losses.data.nuisance.values
    along = nuisance.reshape(len(moved), nuisance.shape[2])
    if along.shape[1]:
        explained = along @ np.linalg.lstsq(along, moved, rcond=None)[0]
        if explained @ explained >= _ALIKE**2 * (moved @ moved):
            registered = "the instrument's frame and target" if problem.aligned.registered else "a constant"
            return f"{registered}, which is fitted along"
    best, found = _ALIKE, ""
    for other in losses.candidates:
        if other.kind != "effect" or other.name == candidate.name:
            continue
        values = problem.whiten(other.columns_um)
        columns = values.reshape(len(moved), values.shape[2])
        cosines = np.abs(moved @ columns) / (np.linalg.norm(columns, axis=0) * np.linalg.norm(moved) + 1e-300)
        k = int(np.argmax(cosines))
        if cosines[k] >= best:
            best, found = cosines[k], f"{other.name} {other.effect.columns(problem.aligned.rows.links)[k].name}"
    return found
