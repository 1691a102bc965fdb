"""Summary of a join in lines for a person."""

from __future__ import annotations

import math

from compd.joining.at_rest import RestJoin
from compd.joining.by_time import JoinResult


def summary_lines(joined: JoinResult | RestJoin) -> list[str]:
    """The way of joining, its certainty, and the rows and points left over."""
    return _by_time(joined) if isinstance(joined, JoinResult) else _at_rest(joined)


def _by_time(joined: JoinResult) -> list[str]:
    clock = joined.offset
    if math.isnan(clock.std_s):
        agreement = "not known" if math.isnan(clock.agreement) else f"{clock.agreement:.4f}"
        offset = f"clock offset {clock.offset_s:+.4f} s, given; agreement with the scales {agreement}"
    else:
        offset = (
            f"clock offset {clock.offset_s:+.4f} s +- {clock.std_s:.4f} s (one standard uncertainty); "
            f"agreement with the scales {clock.agreement:.4f}"
            + (f", next best {clock.runner_up[1]:.4f} at {clock.runner_up[0]:+.2f} s" if clock.runner_up else "")
        )
    rows = len(joined.columns["time_s"])
    return [
        offset,
        f"{joined.matched} of {rows} rows have a reference now (still within {joined.still_mm * 1e3:.1f} um)",
        *(f"    {count} rows without: {reason}" for reason, count in joined.left_out.items()),
    ]


def _at_rest(joined: RestJoin) -> list[str]:
    next_best = ""
    if joined.next_best is not None:
        shift, rms_mm = joined.next_best
        next_best = f"; next best, {shift:+d} dwell{'s' * (abs(shift) != 1)}: {rms_mm:.4g} mm"
    kind = "lengths" if joined.of_lengths else "distances between points"
    return [
        f"joined by {joined.by}: {joined.joined} of {joined.points} points, {len(joined.dwells)} dwells of the machine",
        *(f"    line {line}: {dwell}" for line, dwell in (joined.first, joined.last)),
        f"{kind} agree with the machine's to {joined.rms_mm:.4g} mm rms{next_best}",
        *(f"    left out, {reason}: {which}" for reason, which in joined.left_out.items()),
    ]
