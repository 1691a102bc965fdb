"""A moment on a recording's clock as people read it."""

from __future__ import annotations

from datetime import UTC, datetime

# Clocks that show more count from 1970, and from the year 2001 to 2096: no recording lasts 31 years.
SINCE_1970_S = (1e9, 4e9)


def clock_text(time_s: float) -> str:
    """Seconds on a clock; of one that counts from 1970, date and time.

    >>> clock_text(6000.0), clock_text(1730001495.0)
    ('6000 s', '2024-10-27 03:58:15 UTC')
    """
    if SINCE_1970_S[0] <= time_s < SINCE_1970_S[1]:
        return f"{datetime.fromtimestamp(time_s, UTC):%Y-%m-%d %H:%M:%S} UTC"
    return f"{time_s:.0f} s"
