"""Machines that differ from the others in a parameter of an effect or in their error.

Like is compared with like: the parameter with that of machines of one kinematics, the error with that of machines which
have the same effects, too. A machine's value is compared with the median of all; the scale is their median absolute
deviation, made comparable with a standard deviation, together with the standard error of the machine's own value, in
which the scatter from campaign to campaign counts. A machine that differs moves neither. Errors are compared as ratios,
by their logarithm.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np

from compd.fleet.criteria import FleetCriteria
from compd.fleet.drift import Drift
from compd.fleet.recording_result import RecordingResult
from compd.fleet.steady_effects import steady_effects

# Standard deviation of a normal distribution over its median absolute deviation.
_SIGMA_OF_MAD = 1.4826
# Standard error of the median of a normal distribution over that of the mean.
_OF_MEDIAN = math.sqrt(math.pi / 2)
ERROR, ERROR_LEFT = "error", "error with its effects"


@dataclass(frozen=True)
class OutlyingMachine:
    """A machine with a value unlike those of all others."""

    machine: str  #: its name
    quantity: str  #: ERROR, ERROR_LEFT, or a parameter such as "link_expansion.a".
    value: float  #: value, standard_error: of this machine, in `unit`; the standard error of an error is 0
    standard_error: float
    unit: str  #: of value, median and scatter
    kinematics: str  #: how it and those that it is compared with are built
    median: float  #: of these machines
    machines: int  #: number of these machines that have the quantity
    score: float  #: how far from the median, in robust standard deviations


def outlying_machines(
    results: Sequence[RecordingResult], series: Iterable[Drift], criteria: FleetCriteria = FleetCriteria()
) -> tuple[OutlyingMachine, ...]:
    """Machines that differ, the farthest first.

    series : what `drifts` returns of the same results.
    """
    found: list[OutlyingMachine] = []
    steady = steady_effects(results, criteria)
    for quantity in (ERROR, ERROR_LEFT):
        for (unit, kind, _), errors in _errors(results, quantity, steady).items():
            for machine, score, middle in _far_off(_logarithms(errors), criteria):
                value = median(errors[machine])
                found.append(
                    OutlyingMachine(machine, quantity, value, 0.0, unit, kind, math.exp(middle), len(errors), score)
                )
    parameters: dict[tuple[str, str, str], dict[str, tuple[float, float]]] = {}
    for drift in series:
        if mean := _weighted_mean(drift):
            parameters.setdefault((drift.name, drift.unit, drift.kinematics), {})[drift.machine] = mean
    for (name, unit, kind), values in parameters.items():
        found += [
            OutlyingMachine(machine, name, *values[machine], unit, kind, middle, len(values), score)
            for machine, score, middle in _far_off(values, criteria)
        ]
    return tuple(sorted(found, key=lambda outlying: -outlying.score))


def _errors(
    results: Sequence[RecordingResult], quantity: str, steady: Mapping[str, frozenset[str]]
) -> dict[tuple[str, str, frozenset[str]], dict[str, list[float]]]:
    """(Unit, kinematics, effects) -> machine -> its recordings' errors.

    An error that is left where nothing was found is the error itself.
    """
    errors: dict[tuple[str, str, frozenset[str]], dict[str, list[float]]] = {}
    for result in results:
        value = result.rms_after_um if quantity == ERROR_LEFT and result.estimates else result.rms_before_um
        if value > 0:
            kind = (result.error_unit, result.kinematics, steady[result.machine])
            errors.setdefault(kind, {}).setdefault(result.machine, []).append(value)
    # without any effect this would repeat the error
    return {kind: of for kind, of in errors.items() if quantity == ERROR or kind[2]}


def _logarithms(errors: Mapping[str, Sequence[float]]) -> dict[str, tuple[float, float]]:
    """Machine -> median of the logarithms of its errors, and its standard error from the scatter of its recordings.

    The scatter is the machine's own, and not less than that of all machines: of a few recordings it is not known well.
    """
    middle = {machine: median(map(math.log, values)) for machine, values in errors.items()}
    apart = {machine: [abs(math.log(value) - middle[machine]) for value in of] for machine, of in errors.items()}
    usual = median(distance for distances in apart.values() for distance in distances)
    return {
        machine: (
            middle[machine],
            _OF_MEDIAN * _SIGMA_OF_MAD * max(usual, median(distances)) / math.sqrt(len(distances)),
        )
        for machine, distances in apart.items()
    }


def _weighted_mean(drift: Drift) -> tuple[float, float] | None:
    """Mean over the campaigns, weighted with the standard errors, and its own, by Birge's ratio; None without any."""
    known = np.isfinite(drift.value) & np.isfinite(drift.standard_error) & (drift.standard_error > 0)
    if not known.any():
        return None
    value, weight = drift.value[known], drift.standard_error[known] ** -2
    mean = float(np.average(value, weights=weight))
    ratio = float(np.sum(weight * (value - mean) ** 2)) / max(1, len(value) - 1)
    return mean, float(math.sqrt(max(1.0, ratio) / weight.sum()))


def _far_off(values: Mapping[str, tuple[float, float]], criteria: FleetCriteria) -> list[tuple[str, float, float]]:
    """(machine, its score, the median) of each machine that is far off; values : machine -> value, standard error."""
    if len(values) < criteria.fewest_machines:
        return []
    middle = median(value for value, _ in values.values())
    scatter = _SIGMA_OF_MAD * median(abs(value - middle) for value, _ in values.values())
    scores = {
        machine: abs(value - middle) / scale
        for machine, (value, std) in values.items()
        if (scale := math.hypot(scatter, std)) > 0
    }
    return [(machine, score, middle) for machine, score in scores.items() if score > criteria.outlying_score]
