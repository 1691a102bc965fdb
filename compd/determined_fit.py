"""Numbers of a fit that the rows do not determine: those that move no row, and combinations that move none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from compd.arrays import BoolArray, FloatArray
from compd.comparison import AlignedRecording, FitResult, nuisance_beside
from compd.errors import CompdError, Problem
from compd.statistics import column_norms
from compd.text import join_words
from compd.units import UM_PER_MM

# A number takes part in a combination with so large a share of its largest.
_SHARE = 0.1
# Singular values below this share of the largest are rounding.
_RANK_CUT = 1e-6
# Standard deviation of an even distribution, as a share of its width (GUM, 4.3.7).
_EVEN = 12.0**-0.5
# Numbers that are named.
_MAX_NAMED = 6


def determined(aligned: AlignedRecording, result: FitResult) -> tuple[FitResult, tuple[Problem, ...]]:
    """The fit with a value and a standard error for every number, and what was done to that end.

    A number that moves no row, beside others of its effect that do, is 0 or the middle of its plausible range, and as
    uncertain as this range is wide. Raises CompdError where a number is not determined beside others.
    """
    unknown = ~np.isfinite(np.diag(result.covariance)) | ~np.isfinite(_theta(result))
    if not unknown.any():
        return result, ()
    columns = np.concatenate(
        [np.zeros((*aligned.measured_mm.shape, 0))]
        + [aligned.columns(effect.effect, effect.constants) * UM_PER_MM for effect in result.fitted],
        axis=2,
    )
    still = unknown & (np.abs(columns[result.used]).max(axis=(0, 1), initial=0.0) == 0)
    ends = np.cumsum([0, *(len(effect.theta) for effect in result.fitted)])
    parts = [slice(a, b) for a, b in pairwise(ends.tolist())]
    problems = [
        Problem(
            f"effect {effect.effect.id}",
            f"{_named(result, unknown & ~still | still & still[part].all(), part)} cannot be determined",
            value=_why(aligned, result, columns, still, part),
            allowed="rows that determine each number beside all others",
            next_step=f"leave one of them out; what tells them apart: {effect.effect.separated_by or 'other rows'}",
        )
        for effect, part in zip(result.fitted, parts, strict=True)
        if (unknown & ~still)[part].any() or still[part].all() or not _has_ranges(result, still, part, aligned)
    ]
    if problems:
        raise CompdError(problems)
    remarks = tuple(
        Problem(
            f"effect {effect.effect.id}",
            f"{_named(result, still, part)}: no row shows this",
            allowed="the plausible range as its uncertainty",
            next_step="measure it where it matters",
        )
        for effect, part in zip(result.fitted, parts, strict=True)
        if still[part].any()
    )
    return _held(aligned, result, still, parts), remarks


def _theta(result: FitResult) -> FloatArray:
    return np.concatenate([np.zeros(0), *(effect.theta for effect in result.fitted)])


def _ranges(aligned: AlignedRecording, result: FitResult) -> FloatArray:
    """(P, 2) plausible range of each number."""
    links = aligned.rows.links
    return np.array([c.parameter.theta_range for each in result.fitted for c in each.effect.columns(links)])


def _has_ranges(result: FitResult, still: BoolArray, part: slice, aligned: AlignedRecording) -> bool:
    return bool(np.isfinite(_ranges(aligned, result)[part][still[part]]).all())


def _named(result: FitResult, which: BoolArray, part: slice) -> str:
    """Names of some numbers of an effect."""
    names = [name.partition(".")[2] for name, of in zip(result.names[part], which[part], strict=True) if of]
    more = [f"{len(names) - _MAX_NAMED} more"] if len(names) > _MAX_NAMED else []
    return join_words([*names[:_MAX_NAMED], *more])


def _why(aligned: AlignedRecording, result: FitResult, columns: FloatArray, still: BoolArray, part: slice) -> str:
    """Which numbers move the rows alike, in words."""
    if still[part].all():
        return "no row moves with any of its numbers"
    moving = np.flatnonzero(~still)
    along = nuisance_beside(aligned, result.fitted, columns, result.used)
    together = np.concatenate([columns[:, :, moving], along], axis=2)[result.used]
    flat = together.reshape(-1, together.shape[2])
    names = [result.names[k] for k in moving] + [_along_text(aligned)] * along.shape[2]
    own = np.array([part.start <= k < part.stop for k in moving] + [False] * along.shape[2])
    _, values, directions = np.linalg.svd(flat / column_norms(flat), full_matrices=False)
    texts = []
    for direction in directions[values < _RANK_CUT * values[0]]:
        members = np.abs(direction) >= _SHARE * np.abs(direction).max()
        if (members & own).any():
            texts.append(_alike([name for name, of in zip(names, members, strict=True) if of]))
    return "; ".join(dict.fromkeys(texts)) or "too few rows, or blocks of rows, say anything of them"


def _alike(names: Sequence[str]) -> str:
    different = list(dict.fromkeys(names))
    more = [f"{len(different) - _MAX_NAMED} more"] if len(different) > _MAX_NAMED else []
    return f"{join_words([*different[:_MAX_NAMED], *more])} move the rows alike"


def _along_text(aligned: AlignedRecording) -> str:
    return "the instrument's frame, which is fitted along," if aligned.registered else "what is fitted along"


def _held(aligned: AlignedRecording, result: FitResult, still: BoolArray, parts: Sequence[slice]) -> FitResult:
    """The fit with the numbers that move no row as uncertain as their ranges are wide."""
    low, high = _ranges(aligned, result).T
    theta = np.where(still, np.where((low <= 0) & (high >= 0), 0.0, (low + high) / 2), _theta(result))
    covariance = np.where(still[:, None] | still[None], 0.0, result.covariance)
    covariance[still, still] = ((high - low)[still] * _EVEN) ** 2
    fitted = tuple(
        replace(effect, theta=theta[part], covariance=covariance[part, part])
        for effect, part in zip(result.fitted, parts, strict=True)
    )
    return replace(result, fitted=fitted, covariance=covariance)
