"""Which parameters are plausible: inside their range, or weaker than usual, but never of the other sign."""

from __future__ import annotations

import pytest

from compd.diagnosis.criteria import Criteria
from compd.diagnosis.plausibility import is_plausible

CRITERIA = Criteria(range_sigmas=3.0)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_range_on_one_side_of_zero_gives_the_sign(sign: float) -> None:
    low, high = sorted((sign * 0.5, sign * 200.0))
    assert is_plausible((low, high), sign * 0.1, 0.0, CRITERIA), "weaker than usual"
    assert not is_plausible((low, high), sign * -18.0, 0.1, CRITERIA)
    assert is_plausible((low, high), sign * -0.1, 0.04, CRITERIA), "within three standard errors of nothing"
    assert not is_plausible((low, high), sign * -0.1, float("nan"), CRITERIA)
