"""`python -m tests.scoreboard.sensitivity`: what each number of the diagnosis does to its results.

Every number of `Criteria` is halved and doubled, one at a time, and the prepared cases are diagnosed with it. The
table says for each how many are right, near and dangerous then; a number without an effect on these cases can be any.
With --figures docs/sensitivity.json the reference of the criteria shows them.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

from compd.diagnosis import Criteria
from compd.threshold import Threshold, with_value
from compd.threshold import thresholds as thresholds_of
from tests.scoreboard.parallel import append_results, read_results
from tests.scoreboard.scoring import Result, score
from tests.scoreboard.trial import prepared, read_answer, run

FACTORS = {"half": 0.5, "twice": 2.0}
UNCHANGED = "as it is"


class Variant(NamedTuple):
    """A threshold, and what is done to it."""

    name: str
    change: str


class Trial(NamedTuple):
    """A case with a variant of the criteria."""

    directory: Path
    variant: Variant


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.scoreboard.sensitivity", description=__doc__)
    add = parser.add_argument
    add("--campaigns", type=Path, default=Path("out/campaigns"), help="prepared cases")
    add("--out", type=Path, default=Path("out/sensitivity.jsonl"), help="results, one line each")
    add("--name", nargs="+", default=None, help="these thresholds alone")
    add("--every", type=int, default=1, help="one of so many cases, evenly spread over the families")
    add("--jobs", type=int, default=os.cpu_count(), help="side by side")
    add("--figures", type=Path, default=None, help="write the counts to this file of the documentation, too")
    options = parser.parse_args()
    directories = prepared(options.campaigns)[:: options.every]
    wanted = [variant for variant in variants() if not options.name or variant.name in ("", *options.name)]
    cases = {read_answer(directory)["case"]: directory for directory in directories}
    done = {(result["case"], result["name"], result["change"]) for result in read_results(options.out)}
    todo = [
        Trial(directory, variant)
        for variant in wanted
        for case, directory in cases.items()
        if (case, *variant) not in done
    ]
    failed = append_results(options.out, run_variant, todo, options.jobs)
    results = [result for result in read_results(options.out) if result["case"] in cases]
    print("\n".join(table(results)))
    if options.figures:
        options.figures.write_text(json.dumps(figures(results, options.every), indent=1) + "\n", encoding="utf-8")
    for name, why in failed:
        print(f"failed: {name}: {why}")
    raise SystemExit(bool(failed))


def thresholds() -> dict[str, Threshold]:
    """Every number of `Criteria` by its name; what holds several values has no half."""
    return {name: field for name, field in thresholds_of(Criteria).items() if not isinstance(field.default, tuple)}


def variants() -> list[Variant]:
    """The criteria as they are, then every threshold halved and doubled."""
    return [Variant("", UNCHANGED), *(Variant(name, change) for name in thresholds() for change in FACTORS)]


def changed(variant: Variant) -> Criteria:
    """The criteria with this variant; a count stays whole."""
    if not variant.name:
        return Criteria()
    value = thresholds()[variant.name].default
    varied = value * FACTORS[variant.change]
    return with_value(Criteria(), variant.name, round(varied) if isinstance(value, int) else varied)


def run_variant(trial: Trial) -> dict[str, Any]:
    """The score of one case with a variant of the criteria."""
    scored = score(run(trial.directory, changed(trial.variant)))
    return {
        "case": read_answer(trial.directory)["case"],
        "name": trial.variant.name,
        "change": trial.variant.change,
        "right": scored.right,
        "near": scored.near,
        "dangerous": scored.dangerous,
    }


def figures(results: Sequence[Result], every: int) -> dict[str, Any]:
    """The counts as docs/generate/criteria.py reads them: right/near/dangerous, by threshold and change.

    every : one of so many cases was tried.
    """
    counts = {variant: _counts(results, variant) for variant in variants()}
    unchanged = Variant("", UNCHANGED)
    return {
        "counted": datetime.now(UTC).date().isoformat(),
        "command": "make sensitivity" + (f' OPTIONS="--every {every}"' if every > 1 else ""),
        "cases": counts[unchanged][-1],
        "as it is": _shares(counts[unchanged]),
        "thresholds": {
            name: {change: _shares(counts[Variant(name, change)]) for change in FACTORS}
            for name in thresholds()
            if all(counts[Variant(name, change)][-1] == counts[unchanged][-1] for change in FACTORS)
        },
    }


def table(results: Sequence[Result]) -> Iterator[str]:
    """A Markdown table: right/near/dangerous with every threshold halved and doubled."""
    counts = {variant: _text(_counts(results, variant)) for variant in variants()}
    yield f"As it is, right/near/dangerous of all: {counts[Variant('', UNCHANGED)]}."
    yield ""
    yield "| number | default | half | twice |"
    yield "|---|---|---:|---:|"
    for name, threshold in thresholds().items():
        unit = threshold.unit
        default = f"{threshold.default:g}" + ("" if unit == "1" else f" {unit}")
        cells = " | ".join(counts[Variant(name, change)] for change in FACTORS)
        yield f"| `{name}` | {default} | {cells} |"


def _counts(results: Sequence[Result], variant: Variant) -> list[int]:
    """How many are right, near, dangerous, and how many there are."""
    group = [result for result in results if (result["name"], result["change"]) == variant]
    return [*(sum(result[key] for result in group) for key in ("right", "near", "dangerous")), len(group)]


def _shares(counts: Sequence[int]) -> str:
    return "/".join(str(count) for count in counts[:3])


def _text(counts: Sequence[int]) -> str:
    return f"{_shares(counts)} of {counts[-1]}" if counts[-1] else "-"


if __name__ == "__main__":
    main()
