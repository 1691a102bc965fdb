"""A measuring campaign on the simulated machine, computed without wires or real time: rows of a recording."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from compd.arrays import FloatArray
from compd.configuration import Geometry
from compd.operation_settings import Wiring
from compd.simulation.campaign.campaign_plan import (
    PASS_MM,
    PASS_ROW_EVERY_S,
    PASS_ROWS,
    REPEAT_AFTER_S,
    VISIT_S,
    CampaignItem,
    CampaignPlan,
    switched_off,
)
from compd.simulation.campaign.row_log import LoggedRows, RowLog
from compd.simulation.truth.cause import Cause
from compd.simulation.truth.closure import Posture
from compd.simulation.truth.fixed_places import FixedPlaces
from compd.simulation.truth.instruments import EXACT, ReferenceInstrument
from compd.simulation.truth.motion import ACCELERATION_MM_PER_S2, Move
from compd.simulation.truth.probing import PROBING_STEP_S, probing_steps_mm
from compd.simulation.truth.strengths import Strengths
from compd.simulation.truth.world import World

# Longest step (s) of the time between sessions, for causes with a memory.
MAX_WAIT_S = 300.0


class Campaign:
    """One run of a plan on one machine."""

    def __init__(
        self,
        geometry: Geometry,
        wiring: Wiring,
        plan: CampaignPlan,
        seed: int,
        strengths: Strengths,
        causes: Sequence[Cause] = (),
        *,
        reference: ReferenceInstrument = EXACT,
        balls_M: FloatArray | None = None,
        places: FixedPlaces | None = None,
    ) -> None:
        """seed : of joints and noise.

        balls_M : (points, 3) mm, for a ball plate: the balls that are probed at the plan's points.
        places : of fixed balls and pins: those at which the plan's points are measured.
        """
        weather = plan.weather
        self._world = World(geometry, wiring, seed, strengths=strengths, causes=causes, weather=weather)
        self._mechanism = self._world.mechanism
        self._plan = plan
        self._rng = np.random.default_rng([seed, 2, plan.number])
        self._log = RowLog(self._world, wiring, self._rng, reference, places)
        self._reference = reference
        self._balls_M = balls_M
        self._places = places
        self._direction = np.ones(self._mechanism.scales)
        self._visit = 0

    def run(self) -> LoggedRows:
        """All rows of the plan. Raises KinematicsError if a point cannot be reached."""
        session = 0
        for item in self._plan.items:
            if item.session != session:
                session = item.session
                self._switch_on(item)
            self._wait_until(item.start_s, item)
            self._world.heat(item.heat)
            self._world.force_M_N = item.force_M_N
            if item.kind == "visit":
                self._go_to(item)
                self._add_row(item, item.point)
                if item.repeated:
                    self._stay(REPEAT_AFTER_S)
                    if self._places is not None and self._places.touched:
                        self._touch(item.point - 1)  # lifted off and set down again
                    self._add_row(item, item.point)
            else:
                self._pass(item)
        return self._log.rows

    # --- motion ---------------------------------------------------------------------------------------

    def _switch_on(self, first: CampaignItem) -> None:
        """Wait, switched off and without a load, until the session of `first` begins or its warm-up does."""
        self._world.heat(switched_off(self._mechanism.links))
        self._world.force_M_N = np.zeros(3)
        if self._plan.warm_up:
            self._wait_until(first.start_s - self._plan.warm_up_s, first)
            self._world.heat(self._plan.warm_up[first.session - 1])

    def _wait_until(self, time_s: float, following: CampaignItem) -> None:
        """Stand still until `time_s`. A pass begins with a row on the spot; a visit moves away first."""
        wait = self._stay if following.kind == "pass" else self._world.wait
        while time_s - self._world.time_s > 1e-9:
            wait(min(time_s - self._world.time_s, MAX_WAIT_S))

    def _stay(self, time_s: float) -> None:
        self._world.advance_to(self._world.scale_mm, self._world.posture, time_s, 0.0)

    def _go_to(self, item: CampaignItem) -> None:
        """Move to the item's point, rest, and touch what is to be touched there."""
        self._visit += 1
        guess = self._plan.postures[item.point - 1]
        self._move(self._plan.points_mm[item.point - 1], guess, VISIT_S - 2 * REPEAT_AFTER_S)
        self._touch(item.point - 1)

    def _touch(self, point: int) -> None:
        """Bring the tip to the object that it touches at a point (from 0), if there is one."""
        target_M, guess = self._target_M(point), self._plan.postures[point]
        if target_M is not None:
            for scale_mm in probing_steps_mm(self._world, target_M, guess):
                self._move(scale_mm, guess, PROBING_STEP_S)

    def _target_M(self, point: int) -> FloatArray | None:
        """(3,) rest position of the tip at a point (from 0), with the touch's noise; None at a point without touch."""
        if self._balls_M is not None:
            return self._reference.measure(self._balls_M[point], self._rng)
        if self._places is None or not self._places.touched:
            return None
        end_M, tip_M = self._places.end_M[self._places.end_of_point[point]], self._places.tip_M[point]
        radius_mm = float(np.linalg.norm(tip_M - end_M))
        if radius_mm == 0:  # in a pin
            return self._reference.measure(tip_M, self._rng)
        touched_mm = float(self._reference.measure(np.array([radius_mm]), self._rng)[0])
        return np.asarray(end_M + (tip_M - end_M) * (touched_mm / radius_mm))

    def _move(self, scale_mm: FloatArray, guess: Posture, time_s: float) -> None:
        moved = scale_mm - self._world.scale_mm
        self._direction = np.where(moved != 0, np.sign(moved), self._direction)
        travel_s = Move(self._world.scale_mm, scale_mm).duration_s
        self._world.advance_to(scale_mm, guess, max(time_s, travel_s), travel_s)

    def _pass(self, item: CampaignItem) -> None:
        """Move PASS_MM towards another point and half of it back, with rows at rest and at constant speed."""
        start = self._world.scale_mm
        way = self._plan.points_mm[item.towards - 1] - start
        out = way * min(1.0, PASS_MM / np.abs(way).max())
        self._visit += 1
        self._add_row(item, None)
        for end in (start + out, start + out / 2):
            speed_mm_per_s = steady_speed_mm_per_s(self._world.scale_mm, end, item.speed_mm_per_s)
            move = Move(self._world.scale_mm, end, speed_mm_per_s)
            self._direction = np.sign(end - self._world.scale_mm)
            steady_s = move.duration_s - 2 * speed_mm_per_s / ACCELERATION_MM_PER_S2
            every_s = min(PASS_ROW_EVERY_S, steady_s / PASS_ROWS)
            times = move.duration_s / 2 + every_s * (np.arange(PASS_ROWS) - (PASS_ROWS - 1) / 2)
            before_s = 0.0
            for time_s in [*times.tolist(), move.duration_s + 0.1]:
                step_s = time_s - before_s
                self._world.advance_to(move.position_mm(time_s), self._world.posture, step_s, step_s)
                before_s = time_s
                self._visit += 1
                self._add_row(item, None)

    def _add_row(self, item: CampaignItem, point: int | None) -> None:
        self._log.add(item.session, self._visit, point, self._direction)


def steady_speed_mm_per_s(start_mm: FloatArray, end_mm: FloatArray, speed_mm_per_s: float) -> float:
    """This speed, or one that is held for half of a way too short to reach it."""
    way_mm = float(np.abs(end_mm - start_mm).max())
    if speed_mm_per_s**2 < ACCELERATION_MM_PER_S2 * way_mm:
        return speed_mm_per_s
    return math.sqrt(ACCELERATION_MM_PER_S2 * way_mm / 2)
