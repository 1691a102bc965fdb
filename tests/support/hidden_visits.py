"""Visits of a survey: places, loads on the tip, and heaters, as a user would choose them to learn about a machine."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

# Half edge of the box of points about machine zero, as scale values; a survey begins at its corners. Every other visit
# is a short way from the last one, so that each link approaches its places from both sides.
REACH_MM = 60.0
SHORT_WAY_MM = (2.0, 10.0)
# Share of visits with a load, and the range of loads in {M}.
LOADED_SHARE = 0.45
LOAD_LOW_N, LOAD_HIGH_N = (-30.0, -30.0, -60.0), (30.0, 30.0, 10.0)
# The heaters change after so many visits; their upper limits make a few kelvin in the hours of warm-up between.
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
    """scale_mm: one each. force_M_N: three. heat: what the simulated machine's HEAT takes; None: as it was."""

    scale_mm: list[float]
    force_M_N: list[float]
    heat: dict[str, float | list[float]] | None


def survey_visits(seed: int, count: int, *, heaters: bool) -> list[Visit]:
    """At least 16 visits: the corners of the box and random points in it. heaters : whether they are switched."""
    rng = np.random.default_rng(seed)
    corners = REACH_MM * np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    inside = rng.uniform(-REACH_MM, REACH_MM, ((count + 1) // 2 - len(corners), 3))
    return list(_visits(np.concatenate([corners, inside]), count, rng, heaters))


def check_visits(seed: int, count: int, *, heaters: bool) -> list[Visit]:
    """Visits to random points in the box."""
    rng = np.random.default_rng(seed)
    return list(_visits(rng.uniform(-REACH_MM, REACH_MM, ((count + 1) // 2, 3)), count, rng, heaters))


def visits_to(points_mm: NDArray[np.float64], seed: int) -> list[Visit]:
    """Two visits to each of these points (k, m), without heaters."""
    return list(_visits(points_mm, 2 * len(points_mm), np.random.default_rng(seed), False))


def _visits(points: NDArray[np.float64], count: int, rng: np.random.Generator, heaters: bool) -> Iterator[Visit]:
    """Visits to the points, in an order with short ways, each followed by one a short way off."""
    heat = None
    points = _near_each_other(points)
    for number in range(count):
        if heaters and number % VISITS_PER_HEAT == 0:
            heat = _heat(rng)
        point = points[number // 2]
        if number % 2:
            way = rng.uniform(*SHORT_WAY_MM, len(point)) * rng.choice([-1.0, 1.0], len(point))
            point = np.where(np.abs(point + way) <= REACH_MM, point + way, point - way)
        loaded = rng.uniform() < LOADED_SHARE
        force_M_N = rng.uniform(LOAD_LOW_N, LOAD_HIGH_N).tolist() if loaded else [0.0] * 3
        yield Visit(point.tolist(), force_M_N, heat)


def _near_each_other(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """The points in greedy order: after each the nearest of the remaining ones."""
    order, remaining = [0], set(range(1, len(points)))
    while remaining:
        last = points[order[-1]]
        order.append(min(remaining, key=lambda k: float(np.abs(points[k] - last).max())))
        remaining.remove(order[-1])
    return points[order]


def _heat(rng: np.random.Generator) -> dict[str, float | list[float]]:
    """Random power of every heater."""
    return {name: (rng.uniform(0, 1, np.shape(most)) * most).tolist() for name, most in HEATERS_W.items()}
