"""Run the fault matrix: `python -m tests.injection [CASE ...] [--write docs/faults.json]`."""

from __future__ import annotations

import argparse
from pathlib import Path

from tests.injection.matrix import MATRIX
from tests.injection.measured import write_outcomes
from tests.injection.rig import InjectedMachine
from tests.injection.trial import settle, try_case
from tests.support.simulated import run_directory


def main() -> int:
    """Print every case with what it did; 1 where one is not as it must be."""
    parser = argparse.ArgumentParser(prog="python -m tests.injection", description=__doc__)
    parser.add_argument("case", nargs="*", help="all if left out")
    parser.add_argument("--write", type=Path, help="a file for what was measured")
    arguments = parser.parse_args()
    cases = [case for case in MATRIX if not arguments.case or case.id in arguments.case]
    outcomes = []
    with run_directory() as directory, InjectedMachine(directory) as machine:
        for case in cases:
            settle(machine)
            outcome = try_case(machine, case)
            outcomes.append(outcome)
            mark = "WRONG" if outcome.problems else "good "
            print(
                f"{mark} {case.id:32} {outcome.worst_um:9.2f} um  valid {outcome.valid_share:4.0%}  "
                f"shown {outcome.shown_s:5.2f} s  back {outcome.back_s:5.2f} s  {outcome.states}",
                flush=True,
            )
            for problem in outcome.problems:
                print("      " + problem[:400], flush=True)
    wrong = sum(bool(outcome.problems) for outcome in outcomes)
    print(f"{len(outcomes)} cases, {wrong} not as they must be")
    if arguments.write:
        write_outcomes(arguments.write, outcomes)
    return 1 if wrong else 0


if __name__ == "__main__":
    raise SystemExit(main())
