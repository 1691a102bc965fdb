"""Numbers as people read them."""

from __future__ import annotations

import math

import pytest

from compd.text.numbers_as_text import (
    chance_text,
    estimate_text,
    estimates_text,
    fall_text,
    join_words,
    number_text,
    percent_text,
)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.1234, "0.12 um"),
        (9.96, "10 um"),
        (99.6, "100 um"),  # two digits of 99.6 are 1e+02
        (4200.7, "4.20 mm"),
        (153_700.0, "154 mm"),
        (-1000.0, "-1.00 mm"),
        (999.4, "999 um"),
        (-0.05, "-0.050 um"),
        (0.0, "0 um"),
        (math.nan, "not known"),
    ],
)
def test_a_number_has_the_digits_that_count_and_no_power_of_ten(value: float, text: str) -> None:
    assert number_text(value, "um") == text


def test_a_fall_has_digits_enough_to_be_seen() -> None:
    assert fall_text([105.0, 73.2, 55.0], "um") == "105 -> 73 -> 55 um"
    assert fall_text([2.24, 2.19], "arcsec") == "2.24 -> 2.19 arcsec"
    assert fall_text([1.0, 1.0], "um") == "1.0 -> 1.0 um"


def test_an_estimate_has_as_many_digits_as_its_standard_error() -> None:
    assert estimate_text(1.11321, 0.0214, "ppm/K") == "1.113 +- 0.021 ppm/K"
    assert estimate_text(-1234.0, 55.0, "um") == "-1234 +- 55 um"
    assert estimate_text(0.25, 0.03, "1") == "0.250 +- 0.030"
    assert estimate_text(3.0, math.nan, "um") == "3.00 um (standard error not known)"
    assert estimates_text([0.884, 1.1031], 0.02, "um") == "0.884, 1.103 (+- 0.020) um"


@pytest.mark.parametrize(
    ("share", "text"),
    [(0.9999, "99 %"), (1.0, "100 %"), (1.3, "100 %"), (0.004, "below 1 %"), (-0.2, "0 %"), (0.735, "74 %")],
)
def test_a_share_is_not_rounded_up_to_all_or_down_to_nothing(share: float, text: str) -> None:
    assert percent_text(share) == text


def test_a_probability_is_said_as_people_bet() -> None:
    assert [chance_text(p) for p in (0.001, 0.05, 0.3)] == ["1 time in 1000", "1 time in 20", "1 time in 3"]
    assert chance_text(math.nan) == ""


def test_words_are_joined_as_a_sentence_has_them() -> None:
    assert [join_words(words) for words in ([], ["a"], ["a", "b"], ["a", "b", "c"])] == [
        "",
        "a",
        "a and b",
        "a, b and c",
    ]
