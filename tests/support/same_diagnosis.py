"""Two diagnoses of one recording that was written down in two ways: what differs between them."""

from __future__ import annotations

import re
from collections.abc import Iterator

from compd.diagnosis import Diagnosis
from compd.diagnosis.findings import ParameterEstimate
from tests.support.changed_recordings import COPY

# Covariates that say the same of rows in the order of time.
ORDER = {"time_s", "number_of_row_1"}
# Standard errors of one over those of the other.
STD_RATIO = (0.5, 2.0)


def differences(
    before: Diagnosis, after: Diagnosis, *, standard_errors: float = 1.0, factor: float = 1.0
) -> Iterator[str]:
    """What is not the same, in words: the word, the effects, their numbers, what the rest follows.

    standard_errors : by which a number may differ. factor : of the numbers in `after` over those in `before`.
    """
    if after.verdict != before.verdict:
        yield f"{before.verdict} has become {after.verdict}"
    if effects_of(after) != effects_of(before):
        yield f"{sorted(effects_of(before))} have become {sorted(effects_of(after))}"
        return
    values = numbers_of(after)
    for key, number in numbers_of(before).items():
        name = ".".join(key)
        value, std = values[key].value / factor, values[key].std / factor
        if not abs(value - number.value) <= standard_errors * number.std:
            yield f"{name} = {number.value:.4g} +- {number.std:.2g} has become {value:.4g} +- {std:.2g}"
        elif not STD_RATIO[0] < std / number.std < STD_RATIO[1]:
            yield f"the standard error of {name}, {number.std:.3g}, has become {std:.3g}"
    first, now = (_followed(diagnosis) for diagnosis in (before, after))
    if now != first and {*first, *now} != ORDER:
        yield f"the rest followed {first or 'nothing'}, and now {now or 'nothing'}"


def assert_same(before: Diagnosis, after: Diagnosis, *, standard_errors: float = 1.0, factor: float = 1.0) -> None:
    """The same verdict, effects, numbers and covariate; arguments as of `differences`."""
    found = [*differences(before, after, standard_errors=standard_errors, factor=factor)]
    assert not found, f"{before.summary} -> {after.summary}"


def effects_of(diagnosis: Diagnosis) -> set[str]:
    """Ids of what is named."""
    return {step.effect.id for step in diagnosis.steps}


def numbers_of(diagnosis: Diagnosis) -> dict[tuple[str, str], ParameterEstimate]:
    """Every number of what is named, by effect and name."""
    return {(step.effect.id, number.name): number for step in diagnosis.steps for number in step.parameters}


def _followed(diagnosis: Diagnosis) -> list[str]:
    """The first covariate, whichever of two equal columns it is, in whichever unit."""
    return [_plain(finding.covariate) for finding in diagnosis.depends_on[:1]]


def _plain(column: str) -> str:
    stem = column.removeprefix(COPY).removeprefix("temperature_")
    return re.sub("_(degC|K|m?V|m?A)$", "", stem)
