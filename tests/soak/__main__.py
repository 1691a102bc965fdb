"""A machine without faults, in time-lapse: count what is judged wrong of readings that are right.

python -m tests.soak --hours 24
"""

from __future__ import annotations

import argparse
import logging

import structlog
import yaml

from compd.documents import read_document
from tests.injection.machine import TRIPOD, add_votes
from tests.soak.undisturbed import TimeLapse
from tests.support.paths import CONFIG
from tests.support.simulated import run_directory


def main() -> int:
    """Print what was seen; 1 where there was a false alarm."""
    parser = argparse.ArgumentParser(prog="python -m tests.soak", description=__doc__)
    parser.add_argument("--hours", type=float, default=24.0, help="simulated hours")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    structlog.configure(wrapper_class=structlog.make_filtering_bound_logger(logging.ERROR))
    data = read_document(CONFIG / TRIPOD).data
    add_votes(data)
    with run_directory() as directory:
        path = directory / TRIPOD
        path.write_text(yaml.safe_dump(data))
        result = TimeLapse(path, options.seed).run(options.hours, lambda text: print(text, flush=True))
    print(result.text())
    return 1 if result.alarms else 0


if __name__ == "__main__":
    raise SystemExit(main())
