"""What a comparison of a sample leaves uncertain of the whole recording.

Rows are drawn in groups: the rows of a visit, or single rows. With the mean squares q_i of the residual in the n rows
used, Q their mean and S_g the sum of q_i - Q over group g of G, the variance of Q is (1 - n / N) G / (G - 1) sum S_g^2
/ n^2, for N rows in the recording. The standard error of the rms sqrt(Q) is that of Q divided by 2 sqrt(Q).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.display_unit import format_error
from compd.recording import RecordingSample
from compd.text import number_text
from compd.units import UNIT_KINDS

SECONDS_PER_HOUR = UNIT_KINDS[1]["h"]


def rms_standard_error(residual: FloatArray, group: IntArray, rows: int) -> float:
    """Standard error of the rms of a residual (n, m), by the draw of its rows from so many; nan of a single group.

    group : (n,) number of the group with which each row was drawn.
    """
    squares = np.mean(residual**2, axis=1)
    sums = np.bincount(np.unique(group, return_inverse=True)[1], weights=squares - squares.mean())
    if len(sums) < 2 or not squares.any():
        return 0.0 if len(sums) > 1 else float("nan")
    share_left = max(0.0, 1.0 - len(squares) / rows)
    variance = share_left * len(sums) / (len(sums) - 1) * float(sums @ sums) / len(squares) ** 2
    return float(np.sqrt(variance / squares.mean())) / 2


def drawn_together(visit: IntArray | None, rows: int) -> IntArray:
    """(N,) group of each row: its visit, or itself.  visit : (N,), -1 for none."""
    alone = -2 - np.arange(rows)
    return alone if visit is None else np.where(visit >= 0, visit, alone)


def sample_text(sample: RecordingSample, rows: int, rms_um: float, error_um: float, unit: str) -> str:
    """What was compared and what that leaves uncertain, in sentences.

    rows : that were compared, those that were drawn or some of them.
    error_um : standard error of `rms_um` by the draw.
    """
    residual, error = format_error(rms_um, unit, 3), format_error(error_um, unit, 2)
    return (
        f"{rows:,} of {sample.rows:,} rows{_span(sample)} were compared: a sample. It adds a standard error of {error} "
        f"to the residual of {residual} (rms). The standard errors of parameters are those of the sample. An event "
        f"shorter than {_gap(sample, rows)} can lie between its rows and be missed. Of all rows {sample.incomplete:,} "
        f"lack a number of the machine or of the reference, and {sample.untimed:,} are empty or have no time."
    )


def _span(sample: RecordingSample) -> str:
    hours = (sample.end_s - sample.begin_s) / SECONDS_PER_HOUR
    return "" if np.isnan(hours) else f" over {number_text(hours, digits=3)} h"


def _gap(sample: RecordingSample, rows: int) -> str:
    gap_rows, gap_s = _longest_gap(sample, rows)
    text = f"{gap_rows:,} rows"
    return text if np.isnan(gap_s) else f"about {number_text(gap_s, digits=2)} s ({text})"


def _longest_gap(sample: RecordingSample, rows: int) -> tuple[int, float]:
    """Rows and seconds; as much longer as fewer rows were compared than were drawn."""
    longer = max(1.0, len(sample.row) / rows)
    return round(sample.gap_rows * longer), sample.gap_s * longer


def sample_json(sample: RecordingSample, rows: int) -> dict[str, Any]:
    """The numbers of `sample_text` that are of the recording, for programs."""
    gap_rows, gap_s = _longest_gap(sample, rows)
    return {
        "rows": rows,
        "of": sample.rows,
        "begin_s": sample.begin_s,
        "end_s": sample.end_s,
        "rows_untimed": sample.untimed,
        "rows_incomplete": sample.incomplete,
        "longest_gap_rows": gap_rows,
        "longest_gap_s": gap_s,
    }
