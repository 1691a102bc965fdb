"""Random faults for so many minutes, or none in time-lapse.

python -m tests.soak --minutes 4 --seed 1
python -m tests.soak --without-faults --hours 24
"""

from __future__ import annotations

import argparse
import logging
from pathlib import Path

import structlog
import yaml

from compd.documents import read_document
from tests.injection.rig import TRIPOD, InjectedMachine, add_votes
from tests.injection.truth import MOTION_EVERY_S
from tests.soak.soak import DRAWN, TOGETHER_SHARE, soak
from tests.soak.summary import unseen_ids
from tests.soak.undisturbed import TimeLapse
from tests.support.paths import CONFIG
from tests.support.simulated import run_directory


def main() -> int:
    """Print what was seen; 1 where something of it must not be."""
    parser = argparse.ArgumentParser(prog="python -m tests.soak", description="Random faults, or none in time-lapse.")
    parser.add_argument("--minutes", type=float, default=4.0)
    parser.add_argument("--seed", type=int, default=1, help="faults, their order and places follow from it")
    parser.add_argument("--together", type=float, default=TOGETHER_SHARE, help="share of faults that come in pairs")
    parser.add_argument(
        "--without-faults", action="store_true", help="count false alarms, in time-lapse, without wires"
    )
    parser.add_argument("--hours", type=float, default=24.0, help="simulated hours without faults")
    arguments = parser.parse_args()
    if arguments.without_faults:
        return _without_faults(arguments.hours, arguments.seed)
    with run_directory() as directory, _machine(directory, arguments.seed) as machine:
        summary = soak(machine, arguments.minutes, arguments.seed, _say, arguments.together)
    print(summary.text(unseen_ids(DRAWN)))
    problems = summary.problems()
    for problem in problems:
        print("\n" + problem[:1000])
    return 1 if problems else 0


def _machine(directory: Path, seed: int) -> InjectedMachine:
    return InjectedMachine(directory, seed=seed, truth_every_s=MOTION_EVERY_S)


def _without_faults(hours: float, seed: int) -> int:
    structlog.configure(wrapper_class=structlog.make_filtering_bound_logger(logging.ERROR))
    data = read_document(CONFIG / TRIPOD).data
    add_votes(data)
    with run_directory() as directory:
        path = directory / TRIPOD
        path.write_text(yaml.safe_dump(data))
        result = TimeLapse(path, seed).run(hours, _say)
    print(result.text())
    return 1 if result.alarms else 0


def _say(text: str) -> None:
    print(text, flush=True)


if __name__ == "__main__":
    raise SystemExit(main())
