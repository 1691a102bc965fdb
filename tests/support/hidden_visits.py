"""What a person does to a machine to learn about it: where it goes, what hangs on its tip, what is switched on."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

# The points lie in this box about machine zero, as scale values, a survey's first ones at its corners: what is learned
# is used where it was learned. Half of the visits are a short way from the last one, out or back: each link comes to
# its place from both sides.
REACH_MM = 60.0
SHORT_WAY_MM = (2.0, 10.0)
# Loads as a person would hang them on: sideways either way, down and a little up.
LOADED_SHARE = 0.45
LOAD_LOW_N, LOAD_HIGH_N = (-30.0, -30.0, -60.0), (30.0, 30.0, 10.0)
# Every so many visits other heaters are on: drives, base ring, cabinet by column, platform, tool, lamps; up to W.
# A few kelvin: hours of weather and warm-up pass, and every part has time to follow.
VISITS_PER_HEAT = 6
HEATERS_W = {
    "drives_W": [1.5] * 3,
    "ring_W": 12.0,
    "cabinet_W": [8.0] * 3,
    "platform_W": 2.0,
    "tool_W": 0.1,
    "lamps_W": 20.0,
}


class Visit(NamedTuple):
    """scale_mm, force_M_N: three each. heat: what the simulated machine's HEAT takes; None: as it was."""

    scale_mm: list[float]
    force_M_N: list[float]
    heat: dict[str, float | list[float]] | None


def survey_visits(seed: int, count: int, *, heaters: bool) -> list[Visit]:
    """All over the box, corners and all; for 16 visits or more. `heaters`: whether they are switched."""
    rng = np.random.default_rng(seed)
    corners = REACH_MM * np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    inside = rng.uniform(-REACH_MM, REACH_MM, ((count + 1) // 2 - len(corners), 3))
    return list(_visits(np.concatenate([corners, inside]), count, rng, heaters))


def check_visits(seed: int, count: int, *, heaters: bool) -> list[Visit]:
    """Other places in the box."""
    rng = np.random.default_rng(seed)
    return list(_visits(rng.uniform(-REACH_MM, REACH_MM, ((count + 1) // 2, 3)), count, rng, heaters))


def _visits(points: NDArray[np.float64], count: int, rng: np.random.Generator, heaters: bool) -> Iterator[Visit]:
    """Points one near the other, so that little time is spent on the way; at each a short way out or back."""
    heat = None
    points = _near_each_other(points)
    for number in range(count):
        if heaters and number % VISITS_PER_HEAT == 0:
            heat = _heat(rng)
        point = points[number // 2]
        if number % 2:
            way = rng.uniform(*SHORT_WAY_MM, 3) * rng.choice([-1.0, 1.0], 3)
            point = np.where(np.abs(point + way) <= REACH_MM, point + way, point - way)
        loaded = rng.uniform() < LOADED_SHARE
        force_M_N = rng.uniform(LOAD_LOW_N, LOAD_HIGH_N).tolist() if loaded else [0.0] * 3
        yield Visit(point.tolist(), force_M_N, heat)


def _near_each_other(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same points; after each the nearest of those that are left."""
    order, left = [0], set(range(1, len(points)))
    while left:
        here = points[order[-1]]
        order.append(min(left, key=lambda k: float(np.abs(points[k] - here).max())))
        left.remove(order[-1])
    return points[order]


def _heat(rng: np.random.Generator) -> dict[str, float | list[float]]:
    """Each heater is on at any strength."""
    return {name: (rng.uniform(0, 1, np.shape(most)) * most).tolist() for name, most in HEATERS_W.items()}
