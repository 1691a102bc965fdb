"""How soon fresh worlds find each defect again: `python -m tests.worlds.defects [A B C D deadlock]`."""

from __future__ import annotations

import argparse
import json
import random
from collections.abc import Sequence
from pathlib import Path

from tests.worlds.command import FAILED
from tests.worlds.defects.described import DEFECTS
from tests.worlds.defects.find import Found, Search, search

# What was found, a line each; and the plans that show it.
RESULTS = FAILED / "defects.json"
_FRESH_SEEDS = 10**9
# Of five seeds.
_ENOUGH = 0.8


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the simulated minutes until each seed finds each defect. Returns 1 where too few seeds find one."""
    options = _options(arguments)
    names = options.defects or list(DEFECTS)
    fresh = random.SystemRandom()
    seeds = options.seed or [fresh.randrange(_FRESH_SEEDS) for _ in range(options.seeds)]
    found: list[Found] = []
    print(f"{'defect':9} {'seed':>10} {'minutes':>8}  found by", flush=True)
    for one in search(names, seeds, Search(options.minutes, options.rates, options.machine), options.jobs):
        found.append(one)
        _keep(one, RESULTS)
        by = "-" if one.mark is None else f"{one.mark.what} beside {one.mark.blame}: {one.mark.text[:120]}"
        print(f"{one.defect:9} {one.seed:10} {one.minutes:8.2f}  {by}", flush=True)
    missed = 0
    for name in names:
        minutes = sorted(one.minutes for one in found if one.defect == name and one.mark is not None)
        median = f", median {minutes[len(minutes) // 2]:.2f} min" if minutes else ""
        print(f"{name}: {len(minutes)} of {len(seeds)} seeds within {options.minutes:g} min{median}")
        missed += len(minutes) < _ENOUGH * len(seeds)
    return 1 if missed else 0


def _keep(one: Found, path: Path) -> None:
    """Append a row to the results, and write its plan beside them."""
    path.parent.mkdir(parents=True, exist_ok=True)
    mark = None if one.mark is None else one.mark._asdict()
    row = {"defect": one.defect, "seed": one.seed, "minutes": round(one.minutes, 3), "mark": mark}
    with path.open("a", encoding="utf-8") as rows:
        rows.write(json.dumps(row) + "\n")
    if one.plan is not None:
        plan = path.with_name(f"defect-{one.defect}-{one.seed}.json")
        plan.write_text(one.plan.to_json(), encoding="utf-8")


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.worlds.defects", description=main.__doc__)
    parser.add_argument("defects", nargs="*", metavar="DEFECT", help=f"{', '.join(DEFECTS)}; all by default")
    parser.add_argument("--seeds", type=int, default=5, help="number of fresh seeds")
    parser.add_argument("--seed", type=int, action="append", help="in place of fresh ones; may be given again")
    parser.add_argument("--minutes", type=float, default=60.0, help="simulated minutes until a search ends")
    parser.add_argument("--rates", default="campaign", help="as of `python -m tests.worlds`")
    parser.add_argument("--machine", default="", help="as of `python -m tests.worlds`")
    parser.add_argument("--jobs", type=int, default=2, help="worlds at once")
    options = parser.parse_args(arguments)
    if unknown := set(options.defects) - set(DEFECTS):
        parser.error(f"no defect is called {', '.join(sorted(unknown))}; there are {', '.join(DEFECTS)}")
    return options


if __name__ == "__main__":
    raise SystemExit(main())
