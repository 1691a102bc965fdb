"""The measures that have a target: how often what was wanted was reached."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from tests.scoreboard import scoring
from tests.scoreboard.scoring import Result

# Sizes of errors, over the noise floor, that the targets are stated for: 1 to 6, with the tolerance of sizing.
MIN_FLOORS, MAX_FLOORS = 0.95, 6.3
# Floor ratio on the other recording.
MAX_RATIO = 1.1


@dataclass(frozen=True)
class Measure:
    """what : in words. cases : how many count. reached, wanted : as text, with their unit."""

    what: str
    cases: int
    reached: str
    wanted: str


class OtherDay(NamedTuple):
    """Error on another day, and the limits within which it was to lie with 90 %, um."""

    rms_um: float
    low_um: float
    high_um: float

    @property
    def inside(self) -> bool:
        """Whether the error lies within its limits."""
        return self.low_um <= self.rms_um <= self.high_um


def other_day_limits(results: Iterable[Result]) -> Iterator[OtherDay]:
    """Of each result with another day under the conditions of the first; in the other cases nothing was to be expected.

    Results of earlier runs have no other day.
    """
    for result in results:
        day = result.get("other_day")
        low, high = (day and day["expected_um"]) or (None, None)
        if low is not None and high is not None:
            yield OtherDay(day["final_rms_um"], low, high)


def floors(result: Result) -> tuple[float, ...]:
    """Size of each hidden cause's error over the noise."""
    return tuple(result["answer"].get("error_in_floors", {}).values())


def plain(result: Result) -> bool:
    """Whether every hidden cause has a size that the targets are stated for."""
    return all(MIN_FLOORS <= size <= MAX_FLOORS for size in floors(result))


def measures(results: Sequence[Result]) -> list[Measure]:
    """All measures of these results."""
    of = {
        name: [result for result in results if result["family"] == name and plain(result)]
        for name in ("library", "pair", "nothing", "outside")
    }
    library, outside = of["library"], of["outside"]
    named = [result for result in library if named_first(result)]
    can_be = [result for result in named if reaches(result, "true_floor_ratio")]
    covered = [inside for result in named for _, inside in scoring.intervals(result)]
    took_s = [result["took_s"] for result in results]
    rivals = [len(step["rivals"]) for result in library for step in scoring.steps(result)]
    limits = list(other_day_limits(results))
    bound = _percent([reaches(result, "true_floor_ratio") for result in named])
    return [
        _share("right effect named first, error 1 to 6 times the floor", library, named_first, ">= 97 %"),
        _share("the same, constants not taken as one family", library, named_first_exactly, ""),
        _share("right effect named or among the rivals", library, named_or_rival, "100 %"),
        Measure("rivals of a named effect: median, 95 %", len(rivals), _median("", rivals), ""),
        _share("an effect named that is not there", library, named_wrongly, ""),
        _share("two hidden effects, both named or among the rivals", of["pair"], named_or_rival, ">= 90 %"),
        _share("nothing hidden: says adequate", of["nothing"], is_adequate, ">= 98 %"),
        _share("outside the library: names none", outside, lambda result: not scoring.steps(result), ""),
        _share("outside: names none, right covariate first or second", outside, described, ">= 95 %"),
        Measure(f"other recording <= {MAX_RATIO}, with the true effect fitted: the bound", len(named), bound, ""),
        _share(
            f"other recording <= {MAX_RATIO}, of those that can be",
            can_be,
            lambda result: reaches(result, "other_floor_ratio"),
            "all",
        ),
        Measure(
            "error on another day within its 90 % limits, where they are known",
            len(limits),
            _percent([each.inside for each in limits]),
            "85-95 %",
        ),
        Measure(
            "upper over lower of these limits: median, 95 %",
            len(limits),
            _median("", [each.high_um / each.low_um for each in limits]),
            "<= 1.6",
        ),
        Measure("95 % interval holds the true parameter", len(covered), _percent(covered), "93-97 %"),
        Measure("processor time of a diagnosis: median, 95 %", len(took_s), _median(" s", took_s), "<= 5 s"),
    ]


def named_first(result: Result) -> bool:
    """Whether the first thing said is what was hidden; of constants, any of their family."""
    groups = {name for group in result["expected"].get("groups", ()) for name in group}
    first = scoring.names(result)[:1] or sorted(scoring.constant_effects(result))
    return bool(groups & set(first))


def named_first_exactly(result: Result) -> bool:
    answers: list[str] = result["answer"]["answers"]
    return scoring.names(result)[:1] == answers[:1]


def named_or_rival(result: Result) -> bool:
    """Whether all that was hidden is named, a rival, or what a constant may come from."""
    said = {*scoring.names(result), *scoring.rivals(result), *scoring.constant_effects(result)}
    return all(said & set(group) for group in result["expected"].get("groups", ()))


def named_wrongly(result: Result) -> bool:
    """Whether something is named of which neither effect nor rival is there."""
    there = {name for group in result["expected"].get("groups", ()) for name in group}
    there |= {*result["expected"].get("may_name", ()), *result["answer"].get("weak_disturbances", ())}
    return any(not there & {step["effect"], *step["rivals"]} for step in scoring.steps(result))


def is_adequate(result: Result) -> bool:
    return bool(result["verdict"]["verdict"] == "adequate")


def described(result: Result) -> bool:
    """Whether nothing is named, and the right covariate is first or second."""
    return not scoring.steps(result) and not any("follows" in text for text in scoring.score(result).missing)


def reaches(result: Result, key: str) -> bool:
    """Whether this floor ratio is known and small enough."""
    ratio = result.get(key)
    return ratio is not None and ratio <= MAX_RATIO


def _share(what: str, group: Sequence[Result], right: Callable[[Result], bool], wanted: str) -> Measure:
    return Measure(what, len(group), _percent([right(result) for result in group]), wanted)


def _percent(values: Sequence[bool]) -> str:
    return f"{100 * float(np.mean(values)):.0f} %" if len(values) else "-"


def _median(unit: str, values: Sequence[float]) -> str:
    """Median and 95 % quantile."""
    return ", ".join(f"{np.quantile(values, share):.2g}{unit}" for share in (0.5, 0.95)) if values else "-"
