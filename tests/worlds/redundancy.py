"""What the gauges of a machine say of each other, as far as it is stated or follows from what they measure.

No kind of machine that compd knows has more scales than degrees of freedom, so that its scales say nothing of each
other. A world whose machine has more adds a `Relation` of its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from compd.configuration import Configuration, resolve_channel
from compd.live.acquisition import quantity_limits
from compd.machine_builder import build_model
from compd.operation_settings import FRAME_DISTANCES
from compd.units import UM_PER_MM, unit_of

# Numbers of a relation's channels, in their order: now, and when they were compared first.
Residual = Callable[[Sequence[float], Sequence[float]], float]

# Expansion of any frame against its comparators' rods, ppm/K: none for Super-Invar on Super-Invar, 25 for aluminium.
_EXPANSION_PPM_PER_K = (0.0, 25.0)
# By so much (um) loads may bend the base platform, of which nobody states anything: 100 N at 0.1 um/N.
FRAME_GIVE_UM = 10.0
# Distances between the supports of the base platform, and the thermometers near it.
_SUPPORTS = ("t1", "t2", "t3")
_NEAR_SUPPORTS = ("temperature_base_degC", "temperature_frame_degC")
# As long as the votes of the product, which leave time for polls of two units and for a controller, s.
_PAIR_LASTS_S, _FOLLOWING_LASTS_S = 0.5, 1.0


class Relation(NamedTuple):
    """Channels whose values belong together: a machine without a fault keeps the residual within a limit.

    residual : of the values now and at the first comparison; nan where they cannot be compared now.
    within : its largest size. lasting_s : duration of a larger one that counts, s.
    """

    channels: tuple[str, ...]
    residual: Residual
    within: float
    lasting_s: float = 0.0


def following(channel: str, sign: int, setpoint_mm: Callable[[], float], within_mm: float) -> Relation:
    """A scale follows the setpoint (mm since machine zero) that its controller has. `setpoint_mm`: nan without one.

    Compared from machine zero on, or from a place at which the scale follows.
    """
    first: list[float] = []

    def residual(now: Sequence[float], start: Sequence[float]) -> float:
        commanded_mm = setpoint_mm()
        if math.isnan(commanded_mm):
            return math.nan
        if not first:
            first.append(commanded_mm)
        return sign * (now[0] - start[0]) - (commanded_mm - first[0])

    return Relation((channel,), residual, within_mm, _FOLLOWING_LASTS_S)


def stated_relations(configuration: Configuration, frame_give_um: float = FRAME_GIVE_UM) -> Iterator[Relation]:
    """Relations of a configuration, without commands, which a world adds by `following`."""
    yield from _joint_pairs(configuration)
    yield from _frame(configuration, frame_give_um)
    yield from _neighbours(configuration)


def _channel(configuration: Configuration, reference: str) -> str:
    channel = resolve_channel(reference, configuration.gauges, configuration.drivers)
    assert channel is not None, f"{reference} was checked when the configuration was loaded"
    return channel


def _joint_pairs(configuration: Configuration) -> Iterator[Relation]:
    largest_um = configuration.votes.joint_pair_um
    if largest_um is None:
        return
    wires = {(wire.link, wire.role): wire for wire in configuration.wiring.joint}
    for (link, role), one in wires.items():
        other = wires.get((link, "Rb"))
        if role != "Ra" or other is None:
            continue
        signs = one.sign, other.sign

        def apart_mm(now: Sequence[float], start: Sequence[float], signs: tuple[int, int] = signs) -> float:
            return signs[0] * (now[0] - start[0]) - signs[1] * (now[1] - start[1])

        channels = _channel(configuration, one.gauge), _channel(configuration, other.gauge)
        yield Relation(channels, apart_mm, largest_um / UM_PER_MM, _PAIR_LASTS_S)


def _frame(configuration: Configuration, give_um: float) -> Iterator[Relation]:
    """Every distance against the thermometer that is stated for it, else those between supports against any metal."""
    vote, wiring = configuration.votes.frame, configuration.wiring
    if not wiring.frame:
        return
    distances_mm = build_model(configuration.geometry, wiring).zero.distances_mm
    length_mm = dict(zip(FRAME_DISTANCES, distances_mm.tolist(), strict=True))
    channel = {wire.name: _channel(configuration, wire.gauge) for wire in wiring.quantities}
    for wire in wiring.frame:
        stated = vote is not None and vote.temperature in channel
        if not stated and wire.distance not in _SUPPORTS:
            continue
        names = (vote.temperature,) if stated and vote else tuple(name for name in _NEAR_SUPPORTS if name in channel)
        if not names:
            continue
        ppm = (vote.expansion_ppm_per_K,) * 2 if stated and vote else _EXPANSION_PPM_PER_K
        within_um = vote.tolerance_um if stated and vote else give_um
        own = _channel(configuration, wire.gauge)
        yield Relation(
            (own, *(channel[name] for name in names)),
            _grown(wire.sign, length_mm[wire.distance], ppm),
            within_um / UM_PER_MM,
        )


def _grown(sign: int, length_mm: float, ppm_per_K: tuple[float, float]) -> Residual:
    """By how much (mm) a distance has changed more than its thermometers explain with any expansion of a range."""

    def residual(now: Sequence[float], start: Sequence[float]) -> float:
        changes_K = [value - before for value, before in zip(now[1:], start[1:], strict=True)]
        explained = [1e-6 * ppm * length_mm * change_K for ppm in ppm_per_K for change_K in changes_K]
        grown_mm = sign * (now[0] - start[0])
        return grown_mm - min(max(grown_mm, min(explained)), max(explained))

    return residual


def _neighbours(configuration: Configuration) -> Iterator[Relation]:
    """A quantity is not far from most others of its unit."""
    quantities = configuration.wiring.quantities
    for one in quantities:
        apart = quantity_limits(one).apart
        others = [each for each in quantities if each is not one and unit_of(each.name) == unit_of(one.name)]
        if math.isfinite(apart) and len(others) > 1:
            channels = tuple(_channel(configuration, each.gauge) for each in (one, *others))
            yield Relation(channels, _from_the_middle, apart)


def _from_the_middle(now: Sequence[float], start: Sequence[float]) -> float:
    others = sorted(now[1:])
    return now[0] - 0.5 * (others[(len(others) - 1) // 2] + others[len(others) // 2])
