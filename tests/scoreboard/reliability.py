"""Whether the probability that a verdict states is right: how often the named set was, by what was stated."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from tests.scoreboard.expectation import Expectation
from tests.scoreboard.real import FAMILY as REAL
from tests.scoreboard.scoring import Result, constant_effects, names, wrongly_named

PROBABILITY = "probability"
WIDTH = 0.1
MIN_CASES = 50
# What is wanted: stated and true share of a bin, and the Brier score below that of a constant.
MAX_DIFFERENCE, MIN_REDUCTION = 0.07, 0.3
UNSTATED = "No verdict states a probability: there is no reliability to count."


@dataclass(frozen=True)
class Bin:
    """Cases whose probability is from `least` to `most`. stated : mean of it. right : share with the right set."""

    least: float
    most: float
    cases: int
    stated: float
    right: float

    @property
    def is_calibrated(self) -> bool:
        return abs(self.stated - self.right) <= MAX_DIFFERENCE


@dataclass(frozen=True)
class Reliability:
    """bins : the least probable first. brier : mean square of what was stated less 1 where right, else 0.

    constant_brier : the same for a verdict that states the share of right sets, always.
    """

    cases: int
    bins: tuple[Bin, ...]
    brier: float
    constant_brier: float

    @property
    def reduction(self) -> float:
        """By which share the Brier score is below that of the constant; 0 where all or none are right."""
        return 1 - self.brier / self.constant_brier if self.constant_brier else 0.0

    def as_json(self) -> dict[str, Any]:
        """What `docs.pictures.reliability` draws."""
        return {
            "cases": self.cases,
            "brier": round(self.brier, 4),
            "constant_brier": round(self.constant_brier, 4),
            "bins": [{key: round(value, 4) for key, value in asdict(each).items()} for each in self.bins],
        }


def reliability(results: Sequence[Result]) -> Reliability | None:
    """Of all simulated cases whose verdict states a probability; None where none does.

    In recordings of real machines nobody knows all that was there.
    """
    counted = [
        (float(result["verdict"][PROBABILITY]), named_set_is_right(result))
        for result in results
        if result["family"] != REAL and result["verdict"].get(PROBABILITY) is not None
    ]
    if not counted:
        return None
    stated, right = np.array(counted, dtype=float).T
    share = right.mean()
    return Reliability(
        len(counted),
        tuple(_bins(stated, right)),
        float(np.mean((stated - right) ** 2)),
        float(share * (1 - share)),
    )


def named_set_is_right(result: Result) -> bool:
    """Whether the named effects are those that are there: all that has to be named, and nothing else.

    A rival is not named. Of constants any is right for any other. The empty set is right where nothing has to be named.
    """
    expected = Expectation.from_json(result["expected"])
    said = {*names(result), *constant_effects(result)}
    needed = (*expected.groups, *expected.identified_needs)
    return all(said & set(group) for group in needed) and not wrongly_named(result, expected, with_rivals=False)


def lines(found: Reliability | None) -> Iterator[str]:
    """As a table, in Markdown."""
    if found is None:
        yield UNSTATED
        return
    yield "| stated probability | cases | mean of it | right | within 0.07 |"
    yield "|---|---:|---:|---:|---|"
    for each in found.bins:
        few = f" (fewer than {MIN_CASES})" if each.cases < MIN_CASES else ""
        yield (
            f"| {each.least:.1f} to {each.most:.1f} | {each.cases}{few} | {each.stated:.2f} | {each.right:.2f} | "
            f"{'yes' if each.is_calibrated else 'no'} |"
        )
    yield ""
    yield (
        f"Brier score {found.brier:.3f}, of a constant {found.constant_brier:.3f}: {100 * found.reduction:.0f} % less; "
        f"wanted are {100 * MIN_REDUCTION:.0f} %."
    )


def _bins(stated: np.ndarray[Any, Any], right: np.ndarray[Any, Any]) -> Iterator[Bin]:
    """Tenths, with as many of their upper neighbours as it takes to have MIN_CASES; the last may take lower ones."""
    tenths = np.minimum((stated / WIDTH + 1e-9).astype(int), round(1 / WIDTH) - 1)
    groups: list[list[int]] = [[]]
    for tenth in range(round(1 / WIDTH)):
        if _count(tenths, groups[-1]) >= MIN_CASES:
            groups.append([])
        groups[-1].append(tenth)
    if len(groups) > 1 and _count(tenths, groups[-1]) < MIN_CASES:
        last = groups.pop()
        groups[-1] += last
    for group in groups:
        inside = np.isin(tenths, group)
        yield Bin(
            group[0] * WIDTH,
            (group[-1] + 1) * WIDTH,
            int(inside.sum()),
            float(stated[inside].mean()),
            float(right[inside].mean()),
        )


def _count(tenths: np.ndarray[Any, Any], group: Sequence[int]) -> int:
    return int(np.isin(tenths, group).sum())
