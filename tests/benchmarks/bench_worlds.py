"""Simulated hours an hour of one core, and what bounds them: `python -m tests.benchmarks.bench_worlds [SECONDS]`.

A world (`tests.worlds`) stands, drives from place to place without a rest, or drives and stands by turns. The time is
that of the processor: another program on the same computer changes it little. A second run of each is interrupted every
millisecond, and the newest frame of a part says what the time went to; the figures are of the first, undisturbed one.
"""

from __future__ import annotations

import argparse
import signal
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

import numpy as np

from tests.benchmarks.figures import show
from tests.benchmarks.limits import run_limited
from tests.support.paths import CONFIG
from tests.worlds.test_availability import REACH_MM, drive_until
from tests.worlds.world import World, built

MACHINES = ("tripod-cmm", "hexapod")
SEED = 1
RUN_S = 20.0
MIX_S = 2.0
SAMPLE_S = 1e-3
# Parts by the path of their source; a frame belongs to the first one that fits.
PARTS = {
    "truth": ("compd/simulation/",),
    "wires and hub": ("tests/worlds/", "compd/twins", "compd/lines/", "drivers/"),
    "acquisition": ("compd/live/acquisition/", "compd/live/memory/trust_memory"),
    "loop": ("compd/live/loop/", "compd/live/machine/", "compd/live/memory/", "compd/model/"),
    "service": ("compd/live/service/", "compd/live/record/"),
}
OTHER = "other"
_PART_OF: dict[str, str | None] = {}


def stand(world: World, run_s: float) -> None:
    """Rest at machine zero."""
    world.run(run_s)


def drive(world: World, run_s: float) -> None:
    """Drive from one place to the next without a rest."""
    drive_until(world, np.random.default_rng(SEED), world.hub.now_s + run_s)


def mix(world: World, run_s: float) -> None:
    """Drive to a place, rest there for a random time up to `MIX_S` (s), and so on."""
    rng, end_s = np.random.default_rng(SEED), world.hub.now_s + run_s
    while world.hub.now_s < end_s:
        world.drive(rng.uniform(-REACH_MM, REACH_MM, len(world.scale_mm())).tolist())
        world.arrive(end_s - world.hub.now_s)
        world.run(min(rng.uniform(0.0, MIX_S), max(end_s - world.hub.now_s, 0.0)))


WORKS: dict[str, Callable[[World, float], None]] = {"at rest": stand, "driving": drive, "mix": mix}


def part_of(path: str) -> str | None:
    """The part to which a source file belongs; None for a library."""
    if path not in _PART_OF:
        _PART_OF[path] = next((part for part, of in PARTS.items() if any(name in path for name in of)), None)
    return _PART_OF[path]


@contextmanager
def sampled(into: Counter[str]) -> Iterator[None]:
    """Count, every millisecond of the processor's time, which part runs."""

    def look(_: int, frame: FrameType | None) -> None:
        while frame is not None:
            if part := part_of(frame.f_code.co_filename):
                into[part] += 1
                return
            frame = frame.f_back
        into[OTHER] += 1

    before = signal.signal(signal.SIGPROF, look)
    signal.setitimer(signal.ITIMER_PROF, SAMPLE_S, SAMPLE_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def hours_an_hour(world: World, work: Callable[[World, float], None], run_s: float) -> float:
    """Simulated time over the processor's."""
    from_s, began_s = world.hub.now_s, time.process_time()
    work(world, run_s)
    return (world.hub.now_s - from_s) / (time.process_time() - began_s)


def main() -> None:
    parser = argparse.ArgumentParser(description="Simulated hours of a world an hour of one core")
    parser.add_argument("seconds", nargs="?", type=float, default=RUN_S, help="simulated time of each run, s")
    run_s = parser.parse_args().seconds
    rows = []
    for machine in MACHINES:
        for name, work in WORKS.items():
            with built(CONFIG / f"{machine}.yaml", SEED) as world:
                work(world, run_s / 10)  # what is imported and compiled on the way
                speed = hours_an_hour(world, work, run_s)
                counts: Counter[str] = Counter()
                with sampled(counts):
                    work(world, run_s)
            shares = [f"{100 * counts[part] / max(counts.total(), 1):.0f}" for part in (*PARTS, OTHER)]
            rows.append([f"{machine} {name}", f"{speed:.1f}", *shares])
    title = "Simulated hours an hour of one core, and % of the time in each part"
    show(title, ["", "hours", *PARTS, OTHER], rows)


if __name__ == "__main__":
    run_limited(main, RUN_S=0.2)
