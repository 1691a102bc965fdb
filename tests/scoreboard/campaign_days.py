"""What is measured in a campaign of each family: sessions, visits, heat and weather."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from compd.simulation import AirAtZero, Heat, Mechanism
from compd.simulation.campaign.campaign_plan import (
    GAP_S,
    PASSES_PER_SESSION,
    VISIT_S,
    VISITS_PER_SESSION,
    CampaignItem,
    CampaignPlan,
    draw_campaign_plan,
)
from compd.simulation.truth.fixed_places import FixedPlaces
from compd.simulation.truth.warm_up import COLUMNS
from compd.simulation.truth.weather import Weather, WorkshopWeather
from compd.simulation.truth.workspace import HEIGHT_SHARE, RADIUS_SHARE
from tests.scoreboard import hard_cases as hard
from tests.scoreboard.case import Case

SHORT_ROWS = 90
# Of a recording in which no repeat contradicts the noise that is declared.
UNREPEATED_ROWS = 200
WARM_UP_S = 1500.0
# Temperatures of machine and room when machine zero is taken: of a cold hall, a laboratory, two shops in summer.
ZERO_degC = (15.0, 20.0, 23.0, 27.0)
# One warm-up: visits; heat, W, of drives, ring, cabinet, platform, tool, lamps: least and most; swing of the room, K.
WARM_UP_VISITS = 140
WARM_UP_W = ((4.0, 10.0), (20.0, 60.0), (10.0, 30.0), (3.0, 6.0), (0.2, 0.5), (20.0, 60.0))
STEADY_K = 0.2
# Place by place: heights, and visits at each.
HEIGHTS, VISITS_PER_HEIGHT = 8, 24
# By how much the room is warmer or colder in the campaign than at machine zero, K.
ELSEWHERE_K = (5.0, 12.0)
# Places at which a plane is touched.
TOUCHED = 48
# Families in which the size of an error counts in the usual campaign and not in their own, as in all others.
SIZED_ON_USUAL_DAYS = ("short", "warm-start", hard.WRONG_NOISE)


class LaterWeather(WorkshopWeather):
    """A workshop that has become warmer or colder by `change_K` before its first session."""

    def __init__(self, begin_s: float, change_K: float, *usual: object) -> None:
        """begin_s : of the first session. usual : as for a workshop."""
        super().__init__(*usual)  # type: ignore[arg-type]
        self._begin_s, self._change_K = begin_s, change_K

    def _room_K(self, time_s: float) -> float:
        return super()._room_K(time_s) + self._change_K * min(time_s / self._begin_s, 1.0)


def air_at_zero(case: Case) -> AirAtZero:
    """The air when machine zero is taken."""
    rng = case.rng("zero")
    return AirAtZero(float(rng.choice(ZERO_degC)), round(float(rng.uniform(950.0, 1030.0)), 1), 40.0)


def days(case: Case, mechanism: Mechanism, number: int, places: FixedPlaces | None = None) -> CampaignPlan:
    """The campaign with this number. places : where a plane is touched."""
    air = air_at_zero(case)
    usual = draw_campaign_plan(
        mechanism,
        case.seed,
        number,
        warm_up_s=WARM_UP_S if case.family == "warm-start" else 0.0,
        air_at_zero=air,
        points_mm=None if places is None else places.scale_mm,
        passes=PASSES_PER_SESSION if places is None else 0,
    )
    match case.family:
        case "short" if number == 0:
            return single_visits(usual, SHORT_ROWS)
        case hard.ONE_WARM_UP if number == 0:
            return one_warm_up(case, mechanism, usual, air)
        case hard.PLACE_BY_PLACE if number == 0:
            return place_by_place(case, mechanism, usual, air)
        case hard.WRONG_NOISE if number == 0 and case.rng("repeats").uniform() < 0.5:
            return single_visits(usual, UNREPEATED_ROWS)
        case hard.ZERO_ELSEWHERE:
            return since_a_zero_elsewhere(case, usual, number, air)
    return usual


def single_visits(plan: CampaignPlan, count: int) -> CampaignPlan:
    """The same campaign with `count` of its visits, evenly spread, one row at each, and without passes."""
    visits = [replace(item, repeated=False) for item in plan.items if item.kind == "visit"]
    kept = np.round(np.linspace(0, len(visits) - 1, count)).astype(int)
    return replace(plan, items=tuple(visits[k] for k in kept))


def one_warm_up(case: Case, mechanism: Mechanism, usual: CampaignPlan, air: AirAtZero) -> CampaignPlan:
    """One session from cold under heat that stays as it is, in a room that hardly changes."""
    rng = case.rng("heat")
    drives, ring, cabinet, platform, tool, lamps = WARM_UP_W
    heat = Heat(
        rng.uniform(*drives, mechanism.links),
        rng.uniform(*ring),
        rng.uniform(*cabinet, COLUMNS),
        rng.uniform(*platform),
        rng.uniform(*tool),
        rng.uniform(*lamps),
    )
    items = [item for item in usual.items if item.kind == "visit"][:WARM_UP_VISITS]
    return replace(usual, items=_in_one_session(items, heat), weather=Weather(STEADY_K, rng, air))


def place_by_place(case: Case, mechanism: Mechanism, usual: CampaignPlan, air: AirAtZero) -> CampaignPlan:
    """One session from the lowest to the highest place, or down: all visits at a height follow each other."""
    rng = case.rng("heights")
    # links that are all longer carry the tip higher
    by_height = np.argsort(usual.points_mm.mean(axis=1))[:: rng.choice((-1, 1))]
    points = [
        int(point) + 1
        for group in np.array_split(by_height, HEIGHTS)
        for point in rng.permutation(np.resize(group, VISITS_PER_HEIGHT))
    ]
    items = [item for item in usual.items if item.kind == "visit"][: len(points)]
    placed = [replace(item, point=point) for item, point in zip(items, points, strict=True)]
    weather = WorkshopWeather([0.0], len(points) * VISIT_S, rng, air)
    return replace(usual, items=_in_one_session(placed), weather=weather)


def since_a_zero_elsewhere(case: Case, usual: CampaignPlan, number: int, air: AirAtZero) -> CampaignPlan:
    """The usual sessions, hours after machine zero was taken in a room that was warmer or colder."""
    rng = case.rng("elsewhere")
    change_K = float(rng.uniform(*ELSEWHERE_K) * rng.choice((-1.0, 1.0)))
    items = tuple(replace(item, start_s=item.start_s + GAP_S) for item in usual.items)
    session_s = (VISITS_PER_SESSION + 1) * VISIT_S
    starts_s = [min(item.start_s for item in items if item.session == s) for s in sorted({i.session for i in items})]
    rng = case.rng(f"weather {number}")
    return replace(usual, items=items, weather=LaterWeather(GAP_S, change_K, starts_s, session_s, rng, air))


def touched_plane(case: Case, mechanism: Mechanism) -> FixedPlaces:
    """Places on a level plane, each as a pin that the tip is led into."""
    rng = case.rng("plane")
    length_mm = float(mechanism.lengths0_mm.mean())
    height_mm = round(HEIGHT_SHARE * length_mm * rng.uniform(-0.5, 0.5), 1)
    radius_mm, angle = RADIUS_SHARE * length_mm * np.sqrt(rng.uniform(size=TOUCHED)), rng.uniform(0, 2 * np.pi, TOUCHED)
    away_mm = np.column_stack([radius_mm * np.cos(angle), radius_mm * np.sin(angle), np.zeros(TOUCHED)])
    tip_M = np.round(mechanism.tip0_M + away_mm, 3)
    tip_M[:, 2] = round(float(mechanism.tip0_M[2]) + height_mm, 3)
    scale_mm = np.array([mechanism.scales_at(mechanism.posture_at(tip, np.zeros(3))) for tip in tip_M])
    return FixedPlaces(tip_M, np.arange(TOUCHED), tip_M, scale_mm, touched=True)


def _in_one_session(items: list[CampaignItem], heat: Heat | None = None) -> tuple[CampaignItem, ...]:
    """The items one after the other from time 0."""
    return tuple(replace(item, session=1, start_s=k * VISIT_S, heat=heat or item.heat) for k, item in enumerate(items))
