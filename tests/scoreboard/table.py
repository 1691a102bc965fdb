"""The results as tables, in Markdown."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from tests.scoreboard import scoring
from tests.scoreboard.cases import KINDS
from tests.scoreboard.scoring import Result

# Sizes of errors, over the noise floor, that the targets are stated for: 1 to 6, with the tolerance of sizing.
LEAST_FLOORS, MOST_FLOORS = 0.95, 6.3
MOST_RATIO = 1.1


def report(results: Sequence[Result]) -> str:
    """All tables of these results."""
    by_kind = {kind: [result for result in results if result["kind"] == kind] for kind in KINDS}
    tables = (_summary(by_kind), _by_effect(by_kind["library"]), _confusion(by_kind["library"]), _others(by_kind))
    return "\n\n".join("\n".join(table) for table in tables)


def floors(result: Result) -> tuple[float, ...]:
    """Size of each hidden cause's error over the noise."""
    return tuple(result["secret"]["error_in_floors"].values())


def plain(result: Result) -> bool:
    """Whether every hidden cause has a size that the targets are stated for."""
    return all(LEAST_FLOORS <= size <= MOST_FLOORS for size in floors(result))


def _summary(by_kind: dict[str, list[Result]]) -> Iterator[str]:
    library = [result for result in by_kind["library"] if plain(result)]
    pairs = [result for result in by_kind["pair"] if plain(result)]
    every = [result for group in by_kind.values() for result in group]
    yield "| measure | cases | reached | wanted |"
    yield "|---|---:|---:|---|"
    yield _row("right effect named first, error 1 to 6 times the floor", library, scoring.named_first, ">= 97 %")
    yield _row("right effect named or among the rivals", library, scoring.all_named, "100 %")
    yield _row(
        "an effect named that was not hidden (library)", library, lambda result: bool(scoring.named_wrongly(result)), ""
    )
    yield _row("two hidden effects, both named", pairs, scoring.all_named, ">= 90 %")
    yield _row("nothing hidden: says adequate", by_kind["nothing"], scoring.adequate, ">= 98 %")
    outside = [result for result in by_kind["outside"] if plain(result)]
    yield _row("outside the library: names none", outside, lambda result: not scoring.steps(result), "")
    yield _row(
        "outside: names none, right covariate first or second",
        outside,
        lambda result: not scoring.steps(result) and scoring.covariate_found(result),
        ">= 95 %",
    )
    right = [result for result in library if scoring.named_first(result)]
    yield _row(
        "floor ratio on the other recording <= 1.1, where named rightly",
        right,
        lambda result: result["other_floor_ratio"] <= MOST_RATIO,
        "all",
    )
    covered = [inside for result in right for _, inside in scoring.intervals(result)]
    yield f"| 95 % interval holds the true parameter | {len(covered)} numbers | {_percent(covered)} | 93-97 % |"
    took = [result["took_s"] for result in every]
    if took:
        yield (
            f"| time of `compd diagnose`, start to end: median, 95 % | {len(took)} | {np.median(took):.1f} s, "
            f"{np.quantile(took, 0.95):.1f} s | |"
        )


def _row(what: str, group: Sequence[Result], right: Callable[[Result], bool], wanted: str) -> str:
    return f"| {what} | {len(group)} | {_percent([right(result) for result in group])} | {wanted} |"


def _percent(values: Sequence[bool]) -> str:
    return f"{100 * float(np.mean(values)):.0f} %" if len(values) else "-"


def _by_effect(library: Sequence[Result]) -> Iterator[str]:
    """By effect and strength: how many of the cases named the effect first."""
    sizes = sorted({_asked(result) for result in library})
    cells: dict[tuple[str, float], list[bool]] = defaultdict(list)
    reached: dict[str, float] = defaultdict(float)
    for result in library:
        effect = result["secret"]["answers"][0]
        cells[effect, _asked(result)].append(scoring.named_first(result))
        reached[effect] = max(reached[effect], floors(result)[0])
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
    """Effects that were named first instead of the hidden one, where its size is plain."""
    wrong: dict[str, Counter[str]] = defaultdict(Counter)
    for result in library:
        if plain(result) and not scoring.named_first(result):
            wrong[result["secret"]["answers"][0]][f"{scoring.first(result)} ({result['verdict']['verdict']})"] += 1
    yield "| hidden, 1 to 6 times the floor | named first instead (verdict) |"
    yield "|---|---|"
    for effect, counts in sorted(wrong.items()):
        yield f"| {effect} | " + ", ".join(f"{name} x {count}" for name, count in counts.most_common()) + " |"


def _others(by_kind: dict[str, list[Result]]) -> Iterator[str]:
    """Verdicts for causes outside the library, and where nothing was hidden."""
    yield "| hidden | cases | what was said |"
    yield "|---|---:|---|"
    verdicts: dict[str, Counter[str]] = defaultdict(Counter)
    for result in [*by_kind["outside"], *by_kind["nothing"]]:
        covariates = ", ".join(trend["covariate"] for trend in result["verdict"]["depends_on"][:2])
        names = ", ".join(step["effect"] for step in scoring.steps(result))
        hidden = ", ".join(result["secret"]["effects"]) or "nothing"
        verdicts[hidden][f"{result['verdict']['verdict']} [{names or covariates or '-'}]"] += 1
    for hidden, counts in sorted(verdicts.items()):
        counted = ", ".join(f"{what} x {count}" for what, count in counts.most_common(8))
        yield f"| {hidden} | {sum(counts.values())} | {counted} |"
