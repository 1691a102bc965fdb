"""The results as tables, in Markdown."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from tests.scoreboard import scoring
from tests.scoreboard.scoring import Result

# The acceptance speaks of errors of one to six times the floor; sizing meets them within 5 %.
LEAST_FLOORS, MOST_FLOORS = 0.95, 6.3
MOST_RATIO = 1.1


def report(results: Sequence[Result]) -> str:
    """Everything, one table after the other."""
    by_kind = {
        kind: [one for one in results if one["kind"] == kind] for kind in ("library", "nothing", "outside", "pair")
    }
    tables = (_summary(by_kind), _by_effect(by_kind["library"]), _confusion(by_kind["library"]), _others(by_kind))
    return "\n\n".join("\n".join(table) for table in tables)


def floors(result: Result) -> tuple[float, ...]:
    """How large each hidden cause's error was, over the noise."""
    return tuple(result["secret"]["error_in_floors"].values())


def plain(result: Result) -> bool:
    """Every cause within the sizes that the acceptance speaks of."""
    return all(LEAST_FLOORS <= size <= MOST_FLOORS for size in floors(result))


def _summary(by_kind: dict[str, list[Result]]) -> Iterator[str]:
    library = [one for one in by_kind["library"] if plain(one)]
    pairs = [one for one in by_kind["pair"] if plain(one)]
    every = [one for group in by_kind.values() for one in group]
    yield "| measure | cases | reached | wanted |"
    yield "|---|---:|---:|---|"
    yield _row("right effect named first, error 1 to 6 times the floor", library, scoring.named_first, ">= 97 %")
    yield _row("right effect named or among the rivals", library, scoring.all_named, "100 %")
    yield _row(
        "an effect named that was not hidden (library)", library, lambda one: bool(scoring.named_wrongly(one)), ""
    )
    yield _row("two hidden effects, both named", pairs, scoring.all_named, ">= 90 %")
    yield _row("nothing hidden: says adequate", by_kind["nothing"], scoring.adequate, ">= 98 %")
    outside = [one for one in by_kind["outside"] if plain(one)]
    yield _row("outside the library: names none", outside, lambda one: not scoring.steps(one), "")
    yield _row(
        "outside: names none, right covariate first or second",
        outside,
        lambda one: not scoring.steps(one) and scoring.covariate_found(one),
        ">= 95 %",
    )
    right = [one for one in library if scoring.named_first(one)]
    yield _row(
        "floor ratio on the other recording <= 1.1, where named rightly",
        right,
        lambda one: one["other_floor_ratio"] <= MOST_RATIO,
        "all",
    )
    covered = [inside for one in right for _, inside in scoring.intervals(one)]
    yield f"| 95 % interval holds the true parameter | {len(covered)} numbers | {_percent(covered)} | 93-97 % |"
    took = [one["took_s"] for one in every]
    if took:
        yield (
            f"| time of `compd diagnose`, start to end: median, 95 % | {len(took)} | {np.median(took):.1f} s, "
            f"{np.quantile(took, 0.95):.1f} s | |"
        )


def _row(what: str, group: Sequence[Result], right: Callable[[Result], bool], wanted: str) -> str:
    return f"| {what} | {len(group)} | {_percent([right(one) for one in group])} | {wanted} |"


def _percent(values: Sequence[bool]) -> str:
    return f"{100 * float(np.mean(values)):.0f} %" if len(values) else "-"


def _by_effect(library: Sequence[Result]) -> Iterator[str]:
    """Per effect and strength: named first of how many."""
    sizes = sorted({_asked(one) for one in library})
    cells: dict[tuple[str, float], list[bool]] = defaultdict(list)
    reached: dict[str, float] = defaultdict(float)
    for one in library:
        effect = one["secret"]["answers"][0]
        cells[effect, _asked(one)].append(scoring.named_first(one))
        reached[effect] = max(reached[effect], floors(one)[0])
    yield (
        "| named first, by strength over the floor | "
        + " | ".join(f"{size:g}" for size in sizes)
        + " | largest reached |"
    )
    yield "|---|" + "---:|" * (len(sizes) + 1)
    for effect in sorted(reached):
        counts = [f"{sum(cells[effect, size])}/{len(cells[effect, size])}" for size in sizes]
        yield f"| {effect} | " + " | ".join(counts) + f" | {reached[effect]:.1f} |"


def _asked(result: Result) -> float:
    return float(result["case"].split(":")[1].rpartition("x")[2])


def _confusion(library: Sequence[Result]) -> Iterator[str]:
    """What was named first instead, where the strength was plain."""
    wrong: dict[str, Counter[str]] = defaultdict(Counter)
    for one in library:
        if plain(one) and not scoring.named_first(one):
            wrong[one["secret"]["answers"][0]][f"{scoring.first(one)} ({one['verdict']['verdict']})"] += 1
    yield "| hidden, 1 to 6 times the floor | named first instead (verdict) |"
    yield "|---|---|"
    for effect, counts in sorted(wrong.items()):
        yield f"| {effect} | " + ", ".join(f"{name} x {count}" for name, count in counts.most_common()) + " |"


def _others(by_kind: dict[str, list[Result]]) -> Iterator[str]:
    """Causes outside the library, and false alarms where nothing was hidden."""
    yield "| hidden | cases | what was said |"
    yield "|---|---:|---|"
    said: dict[str, Counter[str]] = defaultdict(Counter)
    for one in [*by_kind["outside"], *by_kind["nothing"]]:
        covariates = ", ".join(found["covariate"] for found in one["verdict"]["depends_on"][:2])
        names = ", ".join(step["effect"] for step in scoring.steps(one))
        hidden = ", ".join(one["secret"]["effects"]) or "nothing"
        said[hidden][f"{one['verdict']['verdict']} [{names or covariates or '-'}]"] += 1
    for hidden, counts in sorted(said.items()):
        told = ", ".join(f"{what} x {count}" for what, count in counts.most_common(8))
        yield f"| {hidden} | {sum(counts.values())} | {told} |"
