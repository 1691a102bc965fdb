"""Quantiles of amounts of any size within 0.05 %."""

from __future__ import annotations

import numpy as np
import pytest

from compd.comparison.stream.residual_totals import MagnitudeHistogram


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("share", [0.5, 0.95])
def test_quantiles_are_those_of_the_values(scale: float, share: float) -> None:
    values = np.random.default_rng(1).normal(0, scale, 20_000)
    histogram = MagnitudeHistogram()
    for part in np.array_split(values, 7):
        histogram.add(part)
    assert histogram.quantile(share) == pytest.approx(np.quantile(np.abs(values), share), rel=6e-4)


def test_zeros_and_nothing() -> None:
    histogram = MagnitudeHistogram()
    histogram.add(np.zeros(0))
    assert np.isnan(histogram.quantile(0.95))
    histogram.add(np.zeros(10))
    assert histogram.quantile(0.95) == 0.0
