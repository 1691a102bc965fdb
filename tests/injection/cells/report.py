"""The results for people: how many cells of each situation are right, and each that is not."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from tests.injection.cells.situation import Situation

Result = dict[str, Any]


def report(outcomes: Sequence[Result], results: Sequence[Result]) -> str:
    """Tables of cases and of cells."""
    return "\n".join([*_cases(outcomes), "", *_by_situation(results), "", *_unseen(results), "", *_wrong(results)])


def _cases(outcomes: Sequence[Result]) -> Iterator[str]:
    yield f"{'':6}{'what happens':32} {'worst, at rest':>14} {'valid':>6} {'shown':>8} {'back':>8}"
    for outcome in outcomes:
        mark = "WRONG" if outcome["problems"] else "good"
        share, shown_s, back_s = outcome["valid_share"], outcome["shown_s"], outcome["back_s"]
        valid = f"{'-':>6}" if share is None else f"{share:6.0%}"
        times = " ".join(f"{'-':>8}" if time_s is None else f"{time_s:6.2f} s" for time_s in (shown_s, back_s))
        yield f"{mark:6}{outcome['case']:32} {_um(outcome['worst_um'])} {valid} {times}"
        yield from (f"    {problem}" for problem in outcome["problems"])


def _by_situation(results: Sequence[Result]) -> Iterator[str]:
    yield f"{'':14} {'cells':>6} {'right':>6} {'wrong':>6} {'unseen':>7}"
    kinds = {situation.value: [r for r in results if _single(r, situation)] for situation in Situation}
    kinds["pairs"] = [result for result in results if len(result["faults"]) > 1]
    for kind, found in kinds.items():
        if found:
            wrong = sum(bool(result["problems"]) for result in found)
            unseen = sum(result["unseen"] for result in found)
            yield f"{kind:14} {len(found):6} {len(found) - wrong:6} {wrong:6} {unseen:7}"


def _single(result: Result, situation: Situation) -> bool:
    return len(result["faults"]) < 2 and result["situation"] == situation.name.lower()


def _unseen(results: Sequence[Result]) -> Iterator[str]:
    yield f"{'what nothing shows, or not at once':52} {'worst error':>14} {'its bound':>14}"
    for result in results:
        if result["unseen"]:
            yield f"{result['cell']:52} {_um(result['worst_um'])} {_um(result['worst_bound_um'])}"


def _wrong(results: Sequence[Result]) -> Iterator[str]:
    yield f"{'what is wrong':52} {'worst error':>14} {'its bound':>14}"
    for result in sorted(results, key=lambda result: -(result["worst_um"] or 0.0)):
        if result["problems"]:
            yield f"{result['cell']:52} {_um(result['worst_um'])} {_um(result['worst_bound_um'])}"
            yield from (f"    {problem}" for problem in result["problems"])


def _um(value: float | None) -> str:
    return f"{'-':>14}" if value is None else f"{value:11.2f} um"
