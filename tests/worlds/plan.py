"""A plan of a world as data: its machine, seed, duration and events; drawn from a seed and rates, kept as JSON."""

from __future__ import annotations

import json
import math
import random
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Self

from compd.configuration import Configuration, load
from tests.worlds.faults.computer import PROCESSES
from tests.worlds.faults.wiring import Wired, wired
from tests.worlds.machines import DRAWN, machine_file
from tests.worlds.rates import Kind

# Acceleration of the drives of a plan without a drive, mm/s2: that of a measuring machine.
MM_PER_S2 = 250.0
_DIGITS = 6
# Parameter of a drive.
_ACCELERATION = "mm_per_s2"


class Event(NamedTuple):
    """Something that happens in a world. time_s : from its beginning. target : "" for the whole machine."""

    time_s: float
    family: str
    kind: str
    target: str
    parameters: Mapping[str, Any]

    @property
    def name(self) -> str:
        return f"{self.family}.{self.kind}"


class Plan(NamedTuple):
    """What a world plays.

    machine : as `machine_file` takes it. seed : of the world. mm_per_s2 : largest acceleration of the drives.
    """

    machine: str
    seed: int
    duration_s: float
    mm_per_s2: float
    events: Sequence[Event]

    def with_events(self, events: Iterable[Event]) -> Self:
        return self._replace(events=tuple(events))

    def to_json(self) -> str:
        """One line for each event."""
        events = ",\n  ".join(json.dumps(event._asdict()) for event in self.events)
        head = json.dumps({**self._asdict(), "events": None})
        return head.replace("null", f"[\n  {events}\n]" if events else "[]") + "\n"

    @classmethod
    def from_json(cls, text: str) -> Self:
        data = json.loads(text)
        return cls(**{**data, "events": tuple(Event(**event) for event in data["events"])})


def draw(seed: int, duration_s: float, kinds: Sequence[Kind], machine: str | None = None) -> Plan:
    """Draw a plan. Events of each kind come independently of all others, at their rate.

    machine : drawn, too, where none is given.
    """
    rng = random.Random(f"plan {seed}")
    drawn = rng.choice(DRAWN)
    machine = machine or drawn
    with tempfile.TemporaryDirectory() as directory:
        configuration = load(machine_file(machine, Path(directory)))
    targets = _targets(configuration)
    events = [
        _event(kind, time_s, targets, len(configuration.wiring.scale), chance)
        for kind in kinds
        # a kind more in the table leaves the others as they are
        for chance in [random.Random(f"{seed} {kind.family}.{kind.name}")]
        if targets[kind.target]
        for time_s in _times_s(kind.per_hour, duration_s, chance)
    ]
    mm_per_s2 = max((event.parameters.get(_ACCELERATION, 0.0) for event in events), default=0.0) or MM_PER_S2
    return Plan(machine, seed, duration_s, mm_per_s2, tuple(sorted(events, key=lambda event: event.time_s)))


def _times_s(per_hour: float, duration_s: float, rng: random.Random) -> Iterable[float]:
    time_s = 0.0
    while per_hour > 0 and (time_s := time_s + rng.expovariate(per_hour / 3600)) < duration_s:
        yield time_s


def _targets(configuration: Configuration) -> Mapping[str, Sequence[str | Wired]]:
    """Everything that a fault can happen to, by its sort."""
    channels = wired(configuration)
    of_kind = {kind: [channel for channel in channels if channel.kind == kind] for kind in ("scale", "joint", "frame")}
    scale_lines = [configuration.gauges[channel.gauge].line for channel in of_kind["scale"]]
    return {
        **of_kind,
        "comparator": [*of_kind["joint"], *of_kind["frame"]],
        # as often a scale as a joint or a frame comparator
        "length": [name for name, found in of_kind.items() if found],
        "thermometer": [channel for channel in channels if channel.source.endswith("_degC")],
        "line": list(configuration.lines),
        "line_of_scales": list(dict.fromkeys(scale_lines)),
        "process": list(PROCESSES),
        "machine": [""],
    }


def _event(
    kind: Kind, time_s: float, targets: Mapping[str, Sequence[str | Wired]], links: int, rng: random.Random
) -> Event:
    target = rng.choice(targets[kind.target])
    if kind.target == "length":
        target = rng.choice(targets[str(target)])
    name, sort = (target.name, target.kind) if isinstance(target, Wired) else (target, "")
    parameters = {}
    for key, stated in kind.parameters.items():
        by_sort = isinstance(stated, Mapping) and "comparator" in stated
        own = stated["scale" if sort == "scale" else "comparator"] if by_sort else stated
        parameters[key] = _drawn(own, rng, links, name, targets)
    return Event(round(time_s, _DIGITS), kind.family, kind.name, name, parameters)


def _drawn(
    stated: Any, rng: random.Random, links: int, target: str, targets: Mapping[str, Sequence[str | Wired]]
) -> Any:
    """A parameter from its range, as rates.yaml states it; a number that stands there is used as it is."""
    if not isinstance(stated, Mapping):
        return stated
    ((how, what),) = stated.items()
    match how:
        case "log":
            return _log(rng, *what)
        case "sign_log":
            return rng.choice((-1, 1)) * _log(rng, *what)
        case "between":
            return round(rng.uniform(*what), _DIGITS)
        case "whole":
            return min(int(_log(rng, what[0], what[1] + 1)), what[1])
        case "one_of":
            return rng.choice(what)
        case "place":
            shares = [rng.uniform(-1, 1) for _ in range(links)]
            longest_mm = _log(rng, *what) / max(map(abs, shares))
            return [round(longest_mm * share, _DIGITS) for share in shares]
        case "links":
            return rng.sample(range(1, links + 1), what)
        case "other":
            return rng.choice([other for other in targets[what] if other != target] or [target])
    raise ValueError(
        f"{how}: no way to draw a parameter; there are log, sign_log, between, whole, one_of, place, links"
    )


def _log(rng: random.Random, low: float, high: float) -> float:
    """Log-uniform, to six significant digits."""
    return float(f"{math.exp(rng.uniform(math.log(low), math.log(high))):.6g}")
