"""The schedule of a measuring campaign: sessions, visits, passes, loads, heat and weather, all from a seed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from compd.arrays import FloatArray
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.warm_up import COLUMNS, Heat
from compd.simulation.truth.weather import STANDARD_AIR, AirAtZero, Weather, WorkshopWeather
from compd.simulation.truth.workspace import draw_points_mm, posture_at_scales

SESSIONS = 4
POINTS = 48
VISITS_PER_SESSION = 96
# Length (mm) of a pass. It goes out and half the way back, with rows in motion: it shows reversals and the influence of
# speed.
PASSES_PER_SESSION = 3
PASS_MM = 24.0
PASS_SPEEDS_MM_PER_S = (2.0, 5.0, 10.0, 20.0)
PASS_ROWS = 4
PASS_ROW_EVERY_S = 0.2
VISIT_S = 25.0
REPEAT_AFTER_S = 2.0
REPEAT_SHARE = 0.25
# Time between sessions; the machine is switched off, and its links cool down to the room.
GAP_S = 4 * 3600.0
HEATS_PER_SESSION = 3
LOADED_SHARE = 0.45
# Range of loads on the tip, N, in {M}.
LOAD_LOW_N, LOAD_HIGH_N = np.array([-30.0, -30.0, -60.0]), np.array([30.0, 30.0, 10.0])
# Upper limits of random heat, W: drives, electronics, cabinet, platform (a spindle), tool, lamps and sun.
DRIVES_W, RING_W, CABINET_W, PLATFORM_W, TOOL_W, LAMPS_W = 3.0, 40.0, 25.0, 4.0, 0.2, 60.0
# Heat of a drive that has run hard, before a session that begins warm: least and most.
WARM_UP_W = (4.0, 10.0)


@dataclass(frozen=True)
class CampaignItem:
    """A visit to a point (1-based), or a pass from there towards another one.

    start_s : when the machine sets out. repeated : a second row at the same visit. heat : sources that are on.
    """

    kind: Literal["visit", "pass"]
    session: int
    start_s: float
    point: int
    towards: int
    force_M_N: FloatArray
    repeated: bool
    speed_mm_per_s: float
    heat: Heat


@dataclass(frozen=True)
class CampaignPlan:
    """A campaign's items in order of time.

    number : of the campaign on the same machine. points_mm : (points, n) scale values. postures : (points, 4, 3) there,
    all parts as drawn. weather : of all sessions.
    warm_up_s, warm_up : time (s) that the machine is on before each session, with this heat (one per session); 0: it is
    switched on as the session begins.
    """

    number: int
    items: tuple[CampaignItem, ...]
    points_mm: FloatArray
    postures: FloatArray
    weather: Weather
    warm_up_s: float = 0.0
    warm_up: tuple[Heat, ...] = ()

    def thinned(self, keep_one_in: int) -> CampaignPlan:
        """The same campaign with one item of every `keep_one_in` of each kind."""
        kinds = {"visit": 0, "pass": 0}
        kept = []
        for item in self.items:
            kinds[item.kind] += 1
            if kinds[item.kind] % keep_one_in == 1:
                kept.append(item)
        return replace(self, items=tuple(kept))


def draw_campaign_plan(
    mechanism: Mechanism,
    seed: int,
    number: int = 0,
    *,
    points_mm: FloatArray | None = None,
    passes: int = PASSES_PER_SESSION,
    warm_up_s: float = 0.0,
    air_at_zero: AirAtZero = STANDARD_AIR,
) -> CampaignPlan:
    """Plan number `number` for the machine of `seed`.

    points_mm : (points, n) scale values to use instead of random points. passes : per session. warm_up_s : time for
    which the machine is on, with its drives hard at work, before the first row of each session. air_at_zero : at
    time 0.
    """
    rng = np.random.default_rng([seed, 1, number])
    if points_mm is None:
        points_mm = draw_points_mm(mechanism, rng, POINTS)
    postures = np.array([posture_at_scales(mechanism, scale_mm) for scale_mm in points_mm])
    session_s = (VISITS_PER_SESSION + passes) * VISIT_S
    starts_s = [warm_up_s + session * (session_s + GAP_S) for session in range(SESSIONS)]
    weather = WorkshopWeather(starts_s, session_s, rng, air_at_zero)
    items = [
        item
        for session, start in enumerate(starts_s, 1)
        for item in _session(session, start, mechanism.links, len(points_mm), passes, rng)
    ]
    if warm_up_s == 0:
        return CampaignPlan(number, tuple(items), points_mm, postures, weather)
    warm_up_rng = np.random.default_rng([seed, 3, number])
    warm_up = tuple(_heat(mechanism.links, warm_up_rng, WARM_UP_W) for _ in starts_s)
    return CampaignPlan(number, tuple(items), points_mm, postures, weather, warm_up_s, warm_up)


def switched_off(links: int) -> Heat:
    """Heat between sessions: none."""
    return Heat(np.zeros(links), 0.0, np.zeros(COLUMNS), 0.0, 0.0, 0.0)


def _session(
    number: int, start_s: float, links: int, points: int, passes: int, rng: np.random.Generator
) -> Iterator[CampaignItem]:
    count = VISITS_PER_SESSION + passes
    every = count // passes if passes else count + 1
    order = _order(points, count, rng)
    heat = _heat(links, rng)
    for k in range(count):
        if k > 0 and k % (count // HEATS_PER_SESSION) == 0:
            heat = _heat(links, rng)
        loaded = rng.uniform() < LOADED_SHARE
        force_M_N = np.round(rng.uniform(LOAD_LOW_N, LOAD_HIGH_N), 2) if loaded else np.zeros(3)
        is_pass = k % every == every - 1
        yield CampaignItem(
            "pass" if is_pass else "visit",
            number,
            start_s + k * VISIT_S,
            order[k],
            order[k + 1],
            force_M_N,
            not is_pass and rng.uniform() < REPEAT_SHARE,
            float(rng.choice(PASS_SPEEDS_MM_PER_S)),
            heat,
        )


def _order(points: int, count: int, rng: np.random.Generator) -> list[int]:
    """count + 1 point numbers from 1: random permutations one after the other, none twice in a row."""
    order: list[int] = []
    while len(order) <= count:
        cycle = (rng.permutation(points) + 1).tolist()
        order += cycle[1:] + cycle[:1] if order and cycle[0] == order[-1] else cycle
    return order[: count + 1]


def _heat(links: int, rng: np.random.Generator, drives_W: tuple[float, float] = (0.0, DRIVES_W)) -> Heat:
    return Heat(
        rng.uniform(*drives_W, links),
        rng.uniform(0, RING_W),
        rng.uniform(0, CABINET_W, COLUMNS),
        rng.uniform(0, PLATFORM_W),
        rng.uniform(0, TOOL_W),
        rng.uniform(0, LAMPS_W),
    )
