"""The score of each family, in the order in which they are shown."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from tests.scoreboard.cases import FAMILIES
from tests.scoreboard.real import FAMILY as REAL
from tests.scoreboard.scoring import Result, Score, score


@dataclass(frozen=True)
class FamilyScore:
    """Counts of right, near and dangerous cases. wanted : per cent of right ones; None where none is stated.

    misses : the cases that are not right, the dangerous ones first.
    """

    name: str
    meaning: str
    wanted: int | None
    cases: int
    right: int
    near: int
    dangerous: int
    misses: tuple[tuple[Result, Score], ...]

    @property
    def percent_right(self) -> float:
        return 100 * self.right / self.cases


def family_scores(results: Sequence[Result]) -> Iterator[FamilyScore]:
    """Every family that has results, then all together."""
    for name, family in FAMILIES.items():
        if group := [result for result in results if result["family"] == name]:
            yield _score(name, family.meaning, family.wanted, group)
    if group := [result for result in results if result["family"] == REAL]:
        yield _score(REAL, "real machines, measured by others", None, group)
    if results:
        yield _score("all", "", None, results, with_misses=False)


def _score(
    name: str, meaning: str, wanted: int | None, group: Sequence[Result], *, with_misses: bool = True
) -> FamilyScore:
    scored = [(result, score(result)) for result in group]
    right, near, dangerous = (sum(getattr(each, kind) for _, each in scored) for kind in ("right", "near", "dangerous"))
    misses = [pair for pair in scored if not pair[1].right]
    misses.sort(key=lambda pair: (not pair[1].dangerous, pair[1].near, str(pair[0]["case"])))
    return FamilyScore(name, meaning, wanted, len(group), right, near, dangerous, tuple(misses if with_misses else ()))
