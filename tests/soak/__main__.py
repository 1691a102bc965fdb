"""Random faults for so many minutes: `python -m tests.soak --minutes 4 --seed 1`."""

from __future__ import annotations

import argparse

from tests.injection.matrix import MATRIX
from tests.injection.rig import InjectedMachine
from tests.soak.soak import soak
from tests.soak.summary import unseen_ids
from tests.support.simulated import run_directory


def main() -> int:
    """Print what was seen; 1 where something of it must not be."""
    parser = argparse.ArgumentParser(prog="python -m tests.soak", description=__doc__)
    parser.add_argument("--minutes", type=float, default=4.0)
    parser.add_argument("--seed", type=int, default=1, help="faults, their order and places follow from it")
    arguments = parser.parse_args()
    with run_directory() as directory, InjectedMachine(directory, seed=arguments.seed) as machine:
        summary = soak(machine, arguments.minutes, arguments.seed, lambda text: print(text, flush=True))
    print(summary.text(unseen_ids(MATRIX)))
    problems = summary.problems()
    for problem in problems:
        print("\n" + problem[:1000])
    return 1 if problems else 0


if __name__ == "__main__":
    raise SystemExit(main())
