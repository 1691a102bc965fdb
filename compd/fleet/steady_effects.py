"""Effects that a machine has on most of its recordings; on a few, an effect may come from chance or weather."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable
from dataclasses import dataclass

from compd.fleet.criteria import FleetCriteria
from compd.fleet.recording_result import RecordingResult


@dataclass(frozen=True)
class LoneEffect:
    """An effect that one machine alone has, among enough that are built alike."""

    machine: str  #: machine, effect: which machine, and the effect's id
    effect: str
    found_on: int  #: found_on, recordings: on how many of its recordings
    recordings: int
    machines: int  #: number of machines of this kinematics, with itself


def steady_effects(
    results: Iterable[RecordingResult], criteria: FleetCriteria = FleetCriteria()
) -> dict[str, frozenset[str]]:
    """Machine -> ids of the effects that it has on more than the share `steady_share` of its recordings."""
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    recordings: Counter[str] = Counter()
    for result in results:
        recordings[result.machine] += 1
        counts[result.machine].update(result.effects)
    return {
        machine: frozenset(
            effect for effect, count in counts[machine].items() if count > criteria.steady_share * of_machine
        )
        for machine, of_machine in recordings.items()
    }


def lone_effects(
    results: Iterable[RecordingResult], criteria: FleetCriteria = FleetCriteria()
) -> tuple[LoneEffect, ...]:
    """Effects that one machine alone has steadily, by machine.

    It takes `fewest_machines` of its kinematics, and two of its recordings with the effect.
    """
    found: list[LoneEffect] = []
    by_kinematics: dict[str, list[RecordingResult]] = defaultdict(list)
    for result in results:
        by_kinematics[result.kinematics].append(result)
    for group in by_kinematics.values():
        steady = steady_effects(group, criteria)
        having = Counter(effect for effects in steady.values() for effect in effects)
        if len(steady) < criteria.fewest_machines:
            continue
        for machine, effects in steady.items():
            own = [result for result in group if result.machine == machine]
            for effect in sorted(effects):
                count = sum(effect in result.effects for result in own)
                if having[effect] == 1 and count > 1:
                    found.append(LoneEffect(machine, effect, count, len(own), len(steady)))
    return tuple(sorted(found, key=lambda lone: (lone.machine, lone.effect)))
