"""The budget: nothing has grown beyond its number, and what was saved is written down."""

from __future__ import annotations

import pytest

from tests.budget.limits import LIMITS
from tests.budget.measures import MEASURES

# A number that is larger than this share of what is counted would let a saving be spent again unseen.
SLACK = 1.01


def test_every_measure_has_a_limit() -> None:
    assert LIMITS.keys() == MEASURES.keys()


@pytest.mark.parametrize("name", MEASURES)
def test_nothing_has_grown_and_every_saving_is_written_down(name: str) -> None:
    counted = MEASURES[name]()
    assert counted <= LIMITS[name], "take something out, or raise the number in a commit that says why"
    assert LIMITS[name] <= SLACK * counted, "tests/budget/numbers.yaml: write down what was saved"
