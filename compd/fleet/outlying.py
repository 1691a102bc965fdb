"""Which machine differs from the others: in a parameter of an effect, or in its error.

A machine's value is compared with the median of all machines; the scale is their median absolute deviation, made
comparable with a standard deviation, together with the standard error of the machine's own value. A machine that
differs moves neither. Errors are compared as ratios, by their logarithm.
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

# Of a normal distribution: standard deviation over median absolute deviation.
_SIGMA_OF_MAD = 1.4826
ERROR, ERROR_LEFT = "error", "error with its effects"


@dataclass(frozen=True)
class OutlyingMachine:
    """A machine with a value that no other machine's is like.

    Attributes
    ----------
    machine : its name.
    quantity : ERROR, ERROR_LEFT, or a parameter such as "link_expansion.a".
    value, standard_error : of this machine, in `unit`; the standard error of an error is 0.
    unit : of value, median and scatter.
    median : of all machines.
    machines : number of machines that have the quantity.
    score : how far from the median, in robust standard deviations.
    """

    machine: str
    quantity: str
    value: float
    standard_error: float
    unit: str
    median: float
    machines: int
    score: float


def outlying_machines(
    results: Sequence[RecordingResult], series: Iterable[Drift], criteria: FleetCriteria = FleetCriteria()
) -> tuple[OutlyingMachine, ...]:
    """Machines that differ, the farthest first.

    series : what `drifts` returns of the same results.
    """
    found: list[OutlyingMachine] = []
    for quantity in (ERROR, ERROR_LEFT):
        for unit, errors in _errors(results, quantity).items():
            logarithms = {machine: (math.log(value), 0.0) for machine, value in errors.items()}
            for machine, score, middle in _far_off(logarithms, criteria):
                found.append(
                    OutlyingMachine(machine, quantity, errors[machine], 0.0, unit, math.exp(middle), len(errors), score)
                )
    parameters: dict[tuple[str, str], dict[str, tuple[float, float]]] = {}
    for drift in series:
        if mean := _weighted_mean(drift):
            parameters.setdefault((drift.name, drift.unit), {})[drift.machine] = mean
    for (name, unit), values in parameters.items():
        for machine, score, middle in _far_off(values, criteria):
            found.append(OutlyingMachine(machine, name, *values[machine], unit, middle, len(values), score))
    return tuple(sorted(found, key=lambda outlying: -outlying.score))


def _errors(results: Sequence[RecordingResult], quantity: str) -> dict[str, dict[str, float]]:
    """Unit -> machine -> the median of its recordings' errors."""
    errors: dict[str, dict[str, list[float]]] = {}
    for result in results:
        value = result.rms_before_um if quantity == ERROR else result.rms_after_um
        if value > 0:
            errors.setdefault(result.error_unit, {}).setdefault(result.machine, []).append(value)
    return {unit: {machine: median(values) for machine, values in of.items()} for unit, of in errors.items()}


def _weighted_mean(drift: Drift) -> tuple[float, float] | None:
    """Mean over the campaigns, weighted with the standard errors, and its own; None where none is known."""
    known = np.isfinite(drift.value) & np.isfinite(drift.standard_error) & (drift.standard_error > 0)
    if not known.any():
        return None
    weight = drift.standard_error[known] ** -2
    return float(np.average(drift.value[known], weights=weight)), float(weight.sum() ** -0.5)


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
