"""The last digit of a display, as an uncertainty: what repeats that are all alike do not show."""

from __future__ import annotations

import numpy as np

from compd.arrays import FloatArray

# Standard deviation of an error spread evenly over one step (GUM, F.2.2.1).
PER_STEP = 12.0**-0.5
# Last digits of displays, from 50 um down to 0.1 nm.
STEPS_UM = tuple(digit * 10.0**power for power in range(1, -5, -1) for digit in (5, 2, 1))


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
