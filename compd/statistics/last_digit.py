"""The last digit of a display, as an uncertainty: what repeats that are all alike do not show."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from compd.arrays import FloatArray

# Standard deviation of an error spread evenly over one step (GUM, F.2.2.1).
PER_STEP = 12.0**-0.5
# Last digits of displays, from 50 um down to 0.1 nm.
STEPS_UM = tuple(digit * 10.0**power for power in range(1, -5, -1) for digit in (5, 2, 1))

# Harmonics of the rounding error that are summed; the sum of all others is below 0.0003 of a squared step.
_HARMONICS = np.arange(1, 201)


def unseen_rounding_um(scatter_um: FloatArray, digit_um: FloatArray) -> FloatArray:
    """(m,) part of the rounding error that is the same in each repeat of a place, um.

    Noise of standard deviation s before rounding to steps of q makes repeats differ by more than s, and leaves of the
    rounding error what they have in common (Widrow and Kollar, Quantization Noise (2008), chapter 5)::

        scatter^2 = s^2 + q^2 / 12 - unseen^2
        unseen^2 = q^2 sum_k exp(-4 pi^2 k^2 s^2 / q^2) / (2 pi^2 k^2)

    Parameters
    ----------
    scatter_um : (m,) standard deviation of rounded repeats, um.
    digit_um : (m,) standard uncertainty of the last digit, q / sqrt(12), um; 0 where nothing is rounded.
    """
    return np.array([_unseen(*pair) for pair in zip(scatter_um, digit_um, strict=True)])


def _unseen(scatter_um: float, digit_um: float) -> float:
    if digit_um == 0 or scatter_um == 0:
        return digit_um
    step_um = digit_um / PER_STEP
    scatter = scatter_um / step_um

    def common(noise: float) -> float:
        terms = np.exp(-((2 * np.pi * _HARMONICS * noise) ** 2)) / (2 * (np.pi * _HARMONICS) ** 2)
        return float(terms.sum())

    def excess(noise: float) -> float:
        return noise**2 + PER_STEP**2 - common(noise) - scatter**2

    # a scatter that is less than the sum's own error
    return digit_um if excess(0.0) >= 0 else step_um * float(np.sqrt(common(brentq(excess, 0.0, scatter))))


def last_digit_um(values_um: FloatArray) -> FloatArray:
    """(m,) standard uncertainty of the last digit of values (N, m); 0 of values that are all alike or have no step."""
    return np.asarray(np.array([_step(column) for column in values_um.T]) * PER_STEP)


def _step(values_um: FloatArray) -> float:
    """The coarsest step, 1, 2 or 5 of any digit, of which all readings are multiples; 0 where they are all alike."""
    values_um = values_um[np.isfinite(values_um)]
    if not len(values_um) or np.ptp(values_um) == 0:
        return 0.0
    for step_um in STEPS_UM:
        counts = values_um / step_um
        multiples = np.round(counts)
        # of values that are all far below a step nothing is seen of it
        if np.ptp(multiples) > 0 and (np.abs(counts - multiples) < 1e-3).all():
            return step_um
    return 0.0
