"""The results as tables, in Markdown."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence

from tests.scoreboard import reliability
from tests.scoreboard.commit import commits_text
from tests.scoreboard.families import FamilyScore, family_scores
from tests.scoreboard.measures import floors, measures, named_first
from tests.scoreboard.scoring import Result


def report(results: Sequence[Result]) -> str:
    """All tables of these results."""
    families = list(family_scores(results))
    tables = (
        [f"{len(results)} cases, commit {commits_text(results)}."],
        _families(families),
        _measures(results),
        reliability.lines(reliability.reliability(results)),
        _by_effect(results),
        _misses(families),
    )
    return "\n\n".join(text for table in tables if (text := "\n".join(table)))


def _families(families: Sequence[FamilyScore]) -> Iterator[str]:
    yield "| family | what it is | cases | right | near | dangerous | wanted right |"
    yield "|---|---|---:|---:|---:|---:|---:|"
    for family in families:
        wanted = "" if family.wanted is None else f"{family.wanted} %"
        yield (
            f"| {family.name} | {family.meaning} | {family.cases} | {family.right} ({family.percent_right:.0f} %) | "
            f"{family.near} | {family.dangerous} | {wanted} |"
        )


def _measures(results: Sequence[Result]) -> Iterator[str]:
    yield "| measure | cases | reached | wanted |"
    yield "|---|---:|---:|---|"
    for measure in measures(results):
        yield f"| {measure.what} | {measure.cases} | {measure.reached} | {measure.wanted} |"


def _by_effect(results: Sequence[Result]) -> Iterator[str]:
    """By effect and strength: how many of the cases of one effect named it first."""
    library = [result for result in results if result["family"] == "library"]
    if not library:
        return
    sizes = sorted({_asked(result) for result in library})
    cells: dict[tuple[str, float], list[bool]] = defaultdict(list)
    largest: dict[str, float] = defaultdict(float)
    for result in library:
        effect = result["answer"]["answers"][0]
        cells[effect, _asked(result)].append(named_first(result))
        largest[effect] = max(largest[effect], floors(result)[0])
    yield "| named first, by strength over the floor | " + " | ".join(f"{s:g}" for s in sizes) + " | largest reached |"
    yield "|---|" + "---:|" * (len(sizes) + 1)
    for effect in sorted(largest):
        counts = [f"{sum(cells[effect, size])}/{len(cells[effect, size])}" for size in sizes]
        yield f"| {effect} | " + " | ".join(counts) + f" | {largest[effect]:.1f} |"


def _asked(result: Result) -> float:
    return float(result["case"].split(":")[1].rpartition("x")[2])


def _misses(families: Sequence[FamilyScore]) -> Iterator[str]:
    """Every case that is not right, with what it lacks."""
    yield "| case | verdict | named (rivals) | what is not right |"
    yield "|---|---|---|---|"
    for result, outcome in (miss for family in families for miss in family.misses):
        mark = "DANGEROUS: " if outcome.dangerous else "near: " if outcome.near else ""
        named = ", ".join(
            step["effect"] + (f" ({', '.join(step['rivals'])})" if step["rivals"] else "")
            for step in result["verdict"]["steps"]
        )
        yield f"| {result['case']} | {result['verdict']['verdict']} | {named} | {mark}{'; '.join(outcome.missing)} |"
