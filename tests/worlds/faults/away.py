"""Devices that are away for a time, and show another value afterwards."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from operator import add

from tests.worlds.faults.fault import Fault
from tests.worlds.faults.layers import Remove, distort, only
from tests.worlds.faults.wiring import Wired, names_on, true_value
from tests.worlds.world import World

# What a channel shows more after its return: (value before, value after) -> more, in its unit.
More = Callable[[float, float], float]
OLD: More = lambda before, after: before - after  # noqa: E731
FROM_ZERO: More = lambda before, after: -after  # noqa: E731


def away(
    world: World,
    lines: Sequence[str],
    take: Callable[[str], Remove],
    away_s: float,
    channels: Sequence[Wired] = (),
    more: More = FROM_ZERO,
    stays_s: float = 0.0,
) -> Fault:
    """Take lines away for `away_s` (s). Afterwards `channels` show `more` for `stays_s` (s), or until a person looks.

    take : takes one line away until the function that it returns is called.
    """
    undo = [take(line) for line in lines]
    before = [true_value(world, channel) for channel in channels]

    def back() -> None:
        if not fault.present:
            return
        end()
        for channel, value in zip(channels, before, strict=True):
            by = more(value, true_value(world, channel))
            undo.append(distort(world, channel.gauge, only(channel.channel, partial(add, by))))

    def end() -> None:
        while undo:
            undo.pop()()

    world.hub.at(world.hub.now_s + away_s, back)
    lasts_s = away_s + (stays_s if channels else 0.0)
    fault = Fault(world, end, lasts_s, mendable=bool(channels), targets=names_on(world, *lines))
    return fault
