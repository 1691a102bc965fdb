"""Within which limits the error on another day lies, from the errors on the days that were left out."""

from __future__ import annotations

import math

import numpy as np
from scipy.special import stdtrit

from compd.diagnosis.search.problem import DiagnosisProblem
from compd.diagnosis.search.subset_losses import SubsetLosses

# With fewer folds their scatter is not known.
MIN_FOLDS = 3


def left_interval_um(problem: DiagnosisProblem, losses: SubsetLosses, members: tuple[int, ...]) -> tuple[float, float]:
    """Between which rms errors, um per coordinate, another recording like these days lies with 90 %; nan if not known.

    Each fold is a day that was left out. Logarithms of the rms of F folds with the standard deviation s predict that of
    one more within t s sqrt(1 + 1 / F), by Student's t for F - 1 degrees of freedom (G. J. Hahn, W. Q. Meeker,
    Statistical Intervals (1991), 4.7). s is not less than what the count n of values allows, 1 / sqrt(2 n).
    """
    by_fold = losses.fold_losses(members)
    count = len(by_fold)
    if count < MIN_FOLDS or not (by_fold > 0).all():
        return math.nan, math.nan
    values = losses.data.value_count / count
    std = max(float(np.log(by_fold).std(ddof=1)) / 2.0, 1.0 / math.sqrt(2.0 * values))
    confidence = (1.0 + problem.criteria.left_confidence) / 2.0
    reach = float(stdtrit(count - 1, confidence)) * std * math.sqrt(1.0 + 1.0 / count)
    middle = problem.unit_um * math.sqrt(float(by_fold.mean()))
    return middle * math.exp(-reach), middle * math.exp(reach)
