"""The command `python -m tests.worlds`: worlds from seeds, beside a progress bar, ending in one line."""

from __future__ import annotations

import argparse
import hashlib
import io
import multiprocessing
import random
import sys
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import yaml

from tests.worlds.compare import first_difference
from tests.worlds.coverage import Coverage
from tests.worlds.known import Known, known_worlds
from tests.worlds.plan import Plan, draw
from tests.worlds.rates import COLUMNS, NONE, kinds_of
from tests.worlds.run import Report, play
from tests.worlds.shrink import shrink

SEEDS = Path(__file__).with_name("seeds.yaml")
# Where failing plans are written.
FAILED = Path("build/worlds")
_BAR = 40
_FRESH_SEEDS = 10**9


class Order(NamedTuple):
    """One world to play. machine : "" for one that is drawn. rates : as of `--rates`."""

    seed: int
    minutes: float
    rates: str
    machine: str = ""

    @property
    def plan(self) -> Plan:
        return draw(self.seed, 60 * self.minutes, kinds_of(self.rates), self.machine or None)

    @property
    def line(self) -> str:
        """The line that repeats it."""
        machine = f" --machine {self.machine}" if self.machine else ""
        return f'make worlds OPTIONS="--seed {self.seed} --minutes {self.minutes:g} --rates {self.rates}{machine}"'


class Played(NamedTuple):
    order: Order
    report: Report


class Total:
    """Sum of the worlds that were played."""

    def __init__(self) -> None:
        self.worlds: list[Played] = []
        self.coverage = Coverage()

    def add(self, played: Played) -> None:
        self.worlds.append(played)
        self.coverage.add(played.report.coverage)

    @property
    def sha256(self) -> str:
        """Of all setpoints: of the digests of the worlds, by seed."""
        digests = sorted((played.order, played.report.sha256) for played in self.worlds)
        return hashlib.sha256("".join(digest for _, digest in digests).encode()).hexdigest()

    def table(self) -> str:
        """Coverage, validity and width of the bound."""
        coverage = self.coverage
        head = ("setpoints", 10), ("valid", 7), ("beyond", 8), ("at most", 8), ("stretches", 9)
        rows = [f"{'state':9} {'family':11} " + " ".join(f"{name:>{width}}" for name, width in head)]
        for case, share in coverage.shares():
            valid = coverage.valid[case] / coverage.all[case]
            beyond = share.beyond / share.setpoints if share.setpoints else float("nan")
            rows.append(
                f"{case.state:9} {case.family:11} {coverage.all[case]:10} {valid:7.2%} {beyond:8.3%} "
                f"{share.upper:8.3%} {share.stretches:9}"
            )
        rows.append(f"bound: median {coverage.width_um(0.5):.3g} um, 95 % below {coverage.width_um(0.95):.4g} um")
        return "\n".join(rows)

    def line(self) -> str:
        """Seeds, hours, setpoints, digest, and what did not hold."""
        reports = [played.report for played in self.worlds]
        hours = sum(report.plan.duration_s for report in reports) / 3600
        setpoints = sum(report.setpoints for report in reports)
        valid = sum(report.coverage.valid.total() for report in reports)
        counted = max(1, sum(report.coverage.all.total() for report in reports))
        broken = Counter(finding.what for report in reports for finding in report.findings)
        said = ", ".join(f"{what} in {count} cases" for what, count in sorted(broken.items())) or "everything held"
        return (
            f"{len(reports)} seeds, {hours:.3f} h, {setpoints} setpoints, {valid / counted:.2%} valid, "
            f"sha256 {self.sha256}: {said}"
        )


def main(arguments: Sequence[str] | None = None) -> int:
    """Play worlds. Returns 1 where something did not hold that is not known."""
    options = _options(arguments)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(line_buffering=True)  # a run of hours says at once what does not hold
    if options.compare:
        return _compare(options)
    total, fails = Total(), 0
    for played in _played(options):
        total.add(played)
        fails += _tell(played, options)
    _bar(1.0)
    print(total.table())
    print(total.line())
    return 1 if fails and not (options.fresh_for and not options.fresh_fails) else 0


def _compare(options: argparse.Namespace) -> int:
    """Compare each seed with kernels for any processor. Returns 1 where a setpoint differs."""
    differ = 0
    for order in _orders(options):
        difference = first_difference(order.plan)
        differ += difference is not None
        print(f"{order.line}: {difference or 'the same setpoints'}")
    return 1 if differ else 0


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.worlds", description=main.__doc__)
    parser.add_argument("--seed", type=int, action="append", help="this seed; may be given again")
    parser.add_argument("--seeds", help="seeds N..M; without any, those of tests/worlds/seeds.yaml")
    parser.add_argument("--minutes", type=float, default=1.0, help="simulated minutes of each seed")
    parser.add_argument("--machine", default="", help="a shipped file, a kind as linear-delta, or a path")
    parser.add_argument("--rates", default="campaign", help=f"{', '.join(COLUMNS)}, {NONE} or a file")
    parser.add_argument("--fresh-for", type=float, default=0.0, metavar="SECONDS", help="fresh seeds, in real time")
    parser.add_argument("--fresh-fails", action="store_true", help="fresh seeds fail the run, too")
    parser.add_argument("--jobs", type=int, default=1, help="worlds at once")
    parser.add_argument("--shrink-for", type=float, default=60.0, metavar="SECONDS", help="for each failing seed")
    parser.add_argument("--compare", action="store_true", help="kernels for any processor against this one's")
    return parser.parse_args(arguments)


def _orders(options: argparse.Namespace) -> Iterator[Order]:
    seeds = list(options.seed or [])
    if options.seeds:
        first, _, last = options.seeds.partition("..")
        seeds += range(int(first), int(last) + 1)
    for seed in seeds:
        yield Order(seed, options.minutes, options.rates, options.machine)
    if seeds:
        return
    if options.fresh_for:
        fresh, until_s = random.SystemRandom(), time.monotonic() + options.fresh_for
        while time.monotonic() < until_s:
            yield Order(fresh.randrange(_FRESH_SEEDS), options.minutes, options.rates, options.machine)
    else:
        yield from fixed_orders()


def fixed_orders(path: Path = SEEDS) -> list[Order]:
    """The fixed list, which must hold."""
    return [Order(**row) for row in yaml.safe_load(path.read_text(encoding="utf-8"))]


def _played(options: argparse.Namespace) -> Iterator[Played]:
    """Every world, as soon as it has been played."""
    orders: Iterable[Order] = _orders(options)
    count = None
    if not options.fresh_for:
        orders = list(orders)
        count = len(orders)
    if options.jobs == 1:
        for done, order in enumerate(orders):
            _bar(done / count if count else None)
            yield _play(order)
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(options.jobs, context) as pool:
        waiting: set[Future[Played]] = set()
        done, coming = 0, iter(orders)
        while True:
            waiting.update(pool.submit(_play, order) for order in islice(coming, 2 * options.jobs - len(waiting)))
            if not waiting:
                return
            future = next(as_completed(waiting))
            waiting.remove(future)
            done += 1
            _bar(done / count if count else None)
            yield future.result()


def _play(order: Order) -> Played:
    return Played(order, play(order.plan))


def _tell(played: Played, options: argparse.Namespace) -> bool:
    """Print what did not hold, shrink it, and say how to repeat it; whether anything of it is not known."""
    order, report = played
    if not report.findings:
        return False
    _bar(None)
    unknown = []
    print(order.line)
    for finding in report.findings:
        known = Known.of(order, finding, known_worlds())
        print(f"  {finding}" + (f" (known: {known.issue})" if known else ""))
        if known is None:
            unknown.append(finding)
    for what in dict.fromkeys(finding.what for finding in unknown):
        small = shrink(report.plan, what, options.shrink_for)
        FAILED.mkdir(parents=True, exist_ok=True)
        path = FAILED / f"{what}-{order.seed}.json"
        path.write_text(small.to_json(), encoding="utf-8")
        play(small, record_to=path.with_suffix(""))
        kinds = ", ".join(event.name for event in small.events) or "no event"
        print(f"  {what}: {len(small.events)} of {len(report.plan.events)} events in {small.duration_s:.2f} s: {kinds}")
        print(f"  {path}")
    return bool(unknown)


def _bar(share: float | None) -> None:
    """Progress on a terminal; None clears it."""
    if sys.stderr.isatty():
        done = 0 if share is None else round(_BAR * share)
        text = "" if share is None else f"[{'#' * done}{'.' * (_BAR - done)}] {share:4.0%}"
        print(f"\r{text:{_BAR + 8}}\r" if share is None else f"\r{text}", end="", file=sys.stderr, flush=True)
