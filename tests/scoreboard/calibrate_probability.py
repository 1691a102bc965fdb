"""`python -m tests.scoreboard.calibrate_probability RESULTS...`: the numbers of `ProbabilityCriteria`.

RESULTS are files of `python -m tests.scoreboard --out`. The logarithm of the odds that the named set is right is linear
in what the verdict says of its evidence (logistic regression by maximum likelihood: Platt, Advances in Large Margin
Classifiers (2000) 61), with a small ridge. Families are left out in turns to see what the numbers are worth on others;
the numbers themselves are from all cases. They are written into `ProbabilityCriteria` by hand.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from compd.diagnosis import Criteria
from tests.scoreboard.parallel import read_results
from tests.scoreboard.real import FAMILY as REAL
from tests.scoreboard.reliability import PROBABILITY, Reliability, lines, named_set_is_right, reliability
from tests.scoreboard.scoring import Result

Floats: TypeAlias = NDArray[np.float64]

NAMES = ("certain", "per_better", "per_told", "above_noise")
# Prior standard deviation of each number but the first: so large an effect is not excluded by few cases.
RIDGE_STD = 3.0
FAMILY_GROUPS = 10


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.scoreboard.calibrate_probability", description=__doc__)
    parser.add_argument("results", type=Path, nargs="+")
    results = [result for path in parser.parse_args().results for result in read_results(path)]
    for line in report(results):
        print(line)


def report(results: Sequence[Result]) -> Iterator[str]:
    """The numbers, and the reliability of what they state of families that they have not seen."""
    stated = [
        result for result in results if result["family"] != REAL and result["verdict"].get(PROBABILITY) is not None
    ]
    evidence, right = (
        np.array([evidence_of(result) for result in stated]),
        np.array(list(map(named_set_is_right, stated))),
    )
    fitted = fit(evidence, right)
    yield f"{len(stated)} cases, {right.sum()} right"
    yield from (f"{name} = {value:.3f}" for name, value in zip(NAMES, fitted, strict=True))
    yield "Of families that were left out:"
    yield from lines(left_out(stated, evidence, right))


def evidence_of(result: Result) -> tuple[float, float, float, float]:
    """What each number multiplies."""
    said = result["verdict"]["probability_from"]
    better = math.log1p(said["better_sets"] / Criteria().probability.unseen)
    return 1.0, -better, -math.log(said["sets_told"]), -float(said["above_noise"])


def fit(evidence: Floats, right: NDArray[np.bool_]) -> Floats:
    """(4,) numbers of the largest likelihood for evidence (N, 4)."""

    def cost(numbers: Floats) -> tuple[float, Floats]:
        odds = evidence @ numbers
        ridge = np.array([0.0, *numbers[1:]]) / RIDGE_STD**2
        value = np.logaddexp(0.0, odds).sum() - odds[right].sum() + float(ridge @ numbers) / 2
        return float(value), evidence.T @ (probabilities(evidence, numbers) - right) + ridge

    return np.asarray(minimize(cost, np.zeros(evidence.shape[1]), jac=True, method="BFGS").x)


def probabilities(evidence: Floats, numbers: Floats) -> Floats:
    """(N,) by the numbers."""
    return np.asarray(1.0 / (1.0 + np.exp(-(evidence @ numbers))))


def left_out(results: Sequence[Result], evidence: Floats, right: NDArray[np.bool_]) -> Reliability | None:
    """Reliability where each group of families has the numbers of the others."""
    families = sorted({result["family"] for result in results})
    group = np.array([families.index(result["family"]) % FAMILY_GROUPS for result in results])
    stated = np.empty(len(results))
    for k in np.unique(group):
        stated[group == k] = probabilities(evidence[group == k], fit(evidence[group != k], right[group != k]))
    return reliability([_with(result, value) for result, value in zip(results, stated.tolist(), strict=True)])


def _with(result: Result, probability: float) -> dict[str, Any]:
    return {**result, "verdict": {**result["verdict"], PROBABILITY: probability}}


if __name__ == "__main__":
    main()
