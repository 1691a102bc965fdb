"""Small multiples: what stands on their axes."""

from __future__ import annotations

import numpy as np
import pytest

from compd.comparison import Covariate
from compd.report.small_multiples import axis_unit


@pytest.mark.parametrize(
    ("name", "unit", "shown"),
    [
        ("direction of link 2", "1", "-1 = shortening, +1 = lengthening"),
        ("direction of axis 1", "1", "-1 = backwards, +1 = forwards"),
        ("moved", "1", ""),
        ("temperature_room", "K", "degC"),
        ("humidity", "%", "%"),
    ],
)
def test_only_a_direction_of_travel_is_shortening_or_lengthening(name: str, unit: str, shown: str) -> None:
    assert axis_unit(Covariate(name, unit, np.zeros(2))) == shown
