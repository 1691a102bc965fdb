"""Moments as people read them."""

from __future__ import annotations

import pytest

from compd.text import clock_text


@pytest.mark.parametrize(
    ("time_s", "text"),
    [
        (0.0, "0 s"),
        (6000.4, "6000 s"),
        (999_999_999.0, "999999999 s"),
        (1_730_001_495.0, "2024-10-27 03:58:15 UTC"),
        (-5.0, "-5 s"),
    ],
)
def test_a_clock_that_counts_from_1970_is_told_as_a_date(time_s: float, text: str) -> None:
    assert clock_text(time_s) == text
