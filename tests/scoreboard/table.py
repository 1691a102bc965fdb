"""The results as tables, in Markdown."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from tests.scoreboard.cases import FAMILIES
from tests.scoreboard.real import FAMILY as REAL
from tests.scoreboard.scoring import Result, score


def report(results: Sequence[Result]) -> str:
    """All tables of these results."""
    return "\n\n".join("\n".join(table) for table in (_by_family(results), _misses(results)))


def _by_family(results: Sequence[Result]) -> Iterator[str]:
    yield "| family | right | near | dangerous | n |"
    yield "|---|---:|---:|---:|---:|"
    groups = {name: [result for result in results if result["family"] == name] for name in (*FAMILIES, REAL)}
    for name, group in (*groups.items(), ("all", results)):
        if group:
            scores = [score(result) for result in group]
            counts = [sum(getattr(each, kind) for each in scores) for kind in ("right", "near", "dangerous")]
            yield f"| {name} | " + " | ".join(map(str, counts)) + f" | {len(group)} |"


def _misses(results: Sequence[Result]) -> Iterator[str]:
    """Every case that is not right, with what it lacks."""
    yield "| case | verdict | named (rivals) | what is not right |"
    yield "|---|---|---|---|"
    for result in sorted(results, key=lambda result: str(result["case"])):
        outcome = score(result)
        if outcome.right:
            continue
        mark = "DANGEROUS: " if outcome.dangerous else "near: " if outcome.near else ""
        named = ", ".join(
            step["effect"] + (f" ({', '.join(step['rivals'])})" if step["rivals"] else "")
            for step in result["verdict"]["steps"]
        )
        yield f"| {result['case']} | {result['verdict']['verdict']} | {named} | {mark}{'; '.join(outcome.missing)} |"
