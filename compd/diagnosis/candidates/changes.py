"""Changes in time: an effect of the library that begins, ends or grows at a moment, as after a crash or a knock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from compd.arrays import BoolArray, FloatArray
from compd.comparison import AlignedRecording
from compd.diagnosis.candidate_criteria import CandidateCriteria
from compd.diagnosis.candidates.candidates import Candidate

# A column that varies by less of what it does in all rows does not vary.
MIN_SHARE = 1e-6


@dataclass(frozen=True, eq=False, kw_only=True)
class ChangeCandidate(Candidate):
    """An effect from a moment on, time_s since its first row.  whole : the same over all rows."""

    time_s: float
    whole: Candidate


def moments_s(aligned: AlignedRecording, criteria: CandidateCriteria = CandidateCriteria()) -> list[float]:
    """Moments at which something may have changed, s: where sessions but the first start, and quantiles of the rows.

    None without the times of rows: the order of rows may be that of places.
    """
    if not aligned.recording.has_time:
        return []
    time_s = aligned.rows.time_s
    starts = time_s[aligned.rows.session_start][1:]
    starts = starts[:: max(1, -(-len(starts) // criteria.max_session_starts))]
    quantiles = np.quantile(time_s, np.linspace(0, 1, criteria.moments + 2)[1:-1])
    return sorted({*starts.tolist(), *quantiles.tolist()})


def moments_between_s(
    moments: Sequence[float], moment_s: float, criteria: CandidateCriteria = CandidateCriteria()
) -> list[float]:
    """Moments between one of those that were tried, s, and its neighbours."""
    index = list(moments).index(moment_s)
    ends = [moments[other] for other in (index - 1, index + 1) if 0 <= other < len(moments)]
    return [float(new) for end in ends for new in np.linspace(moment_s, end, criteria.moments_between + 2)[1:-1]]


def change_candidates(
    candidates: Sequence[Candidate],
    aligned: AlignedRecording,
    times_s: Sequence[float],
    criteria: CandidateCriteria = CandidateCriteria(),
) -> list[ChangeCandidate]:
    """Each of some effects from each moment on; what it did before stays as it is. A drift begins at nought.

    An effect that varies with something has to vary after the moment, too: else all rows are shifted alike, which says
    nothing of the effect.
    """
    time_s = aligned.rows.time_s
    return [
        ChangeCandidate(
            name=f"{candidate.name} change",
            effect=candidate.effect,
            columns_um=_after(candidate.columns_um, time_s, moment_s, drifts=candidate.effect.needs == ("time",)),
            limits=np.ptp(candidate.limits, axis=1)[:, None] * [-1.0, 1.0],
            searched_parameters=candidate.searched_parameters + criteria.searched_constant,
            constants=candidate.constants,
            kind="change",
            time_s=moment_s,
            whole=candidate,
        )
        for candidate in candidates
        for moment_s in times_s
        if _may_change(candidate.columns_um[aligned.usable.mask], time_s[aligned.usable.mask] >= moment_s)
    ]


def _may_change(columns_um: FloatArray, after: BoolArray) -> bool:
    """Whether columns (N, m, P) vary in the rows `after` (N,), or never do."""
    known = np.isfinite(columns_um).all(axis=(1, 2))
    if not (known & after).any():
        return False
    varies = np.ptp(columns_um[known], axis=0)
    return not varies.any() or bool((np.ptp(columns_um[known & after], axis=0) > MIN_SHARE * varies).any())


def _after(columns_um: FloatArray, time_s: FloatArray, moment_s: float, *, drifts: bool) -> FloatArray:
    after = time_s >= moment_s
    if drifts and after.any():
        columns_um = columns_um - columns_um[np.argmax(after)]
    return np.where(after[:, None, None], columns_um, 0.0)
