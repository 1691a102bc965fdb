"""A planned measurement on the simulated machine, computed without wires or real time: rows of a recording."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from compd.arrays import FloatArray
from compd.configuration import Geometry
from compd.operation_settings import Wiring
from compd.simulation.campaign.campaign import MAX_WAIT_S
from compd.simulation.campaign.campaign_plan import PASS_ROW_EVERY_S, REPEAT_AFTER_S
from compd.simulation.campaign.row_log import LoggedRows, RowLog
from compd.simulation.truth.cause import Cause
from compd.simulation.truth.heat import HELD_TIME_CONSTANT_S
from compd.simulation.truth.instruments import ReferenceInstrument
from compd.simulation.truth.plan_motion import Stage, plan_stages
from compd.simulation.truth.planned_row import PlannedRow
from compd.simulation.truth.strengths import Strengths
from compd.simulation.truth.weather import STANDARD_AIR, AirAtZero, Weather
from compd.simulation.truth.world import World

SESSION = 1


class PlannedCampaign:
    """One run of a plan file's rows on one machine.

    Between the planned rows the gauges are read without the reference, so that the recording contains the history of
    scales and temperatures: at every reversal, while parts warm up, before and after a row on the move.
    """

    def __init__(
        self,
        geometry: Geometry,
        wiring: Wiring,
        rows: Sequence[PlannedRow],
        seed: int,
        number: int,
        strengths: Strengths,
        causes: Sequence[Cause],
        reference: ReferenceInstrument,
        air_at_zero: AirAtZero = STANDARD_AIR,
    ) -> None:
        """seed : of joints, weather and noise. number : of the campaign, with weather and noise of its own."""
        weather = Weather(strengths.room_swing_K, np.random.default_rng([seed, 1, number]), air_at_zero)
        self._world = World(geometry, wiring, seed, strengths=strengths, causes=causes, weather=weather)
        rng = np.random.default_rng([seed, 4, number])
        self._log = RowLog(self._world, wiring, rng, reference)
        self._rows = rows
        self._direction: FloatArray = np.ones(geometry.scales)
        self._visit = 0

    def run(self) -> LoggedRows:
        """All rows. Raises KinematicsError if a place cannot be reached."""
        for stage in plan_stages(self._rows, self._world.scale_mm, self._world.hold):
            if stage.purpose != "look":
                self._travel_or_wait(stage)
            elif stage.row.on_the_move:
                self._measure_on_the_move(stage)
            else:
                self._measure_at_rest(stage)
        return self._log.rows

    def _travel_or_wait(self, stage: Stage) -> None:
        """A stage without the reference; the gauges are read often enough to follow motion and temperatures."""
        every_s = HELD_TIME_CONSTANT_S if stage.purpose == "settle" else MAX_WAIT_S
        steps = int(np.ceil(stage.duration_s / every_s))
        for k in range(steps):
            self._advance(stage, k * stage.duration_s / steps, (k + 1) * stage.duration_s / steps)
            self._add_row(None, measured=False)

    def _measure_at_rest(self, stage: Stage) -> None:
        """The reference measures twice, so that their difference shows its noise."""
        self._advance(stage, 0.0, stage.duration_s)
        self._add_row(stage.row.point, measured=True)
        self._advance(stage, stage.duration_s, stage.duration_s + REPEAT_AFTER_S)
        self._add_row(stage.row.point, measured=True, same_visit=True)

    def _measure_on_the_move(self, stage: Stage) -> None:
        """The reference measures in the middle of the move; gauges are read shortly before and after, and at rest."""
        middle_s = stage.move.duration_s / 2
        times_s = [middle_s - PASS_ROW_EVERY_S, middle_s, middle_s + PASS_ROW_EVERY_S, stage.duration_s]
        for since_s, time_s in zip([0.0, *times_s], times_s, strict=False):
            self._advance(stage, since_s, time_s)
            self._add_row(None, measured=time_s == middle_s)

    def _advance(self, stage: Stage, since_s: float, time_s: float) -> None:
        """Advance the world from one time of the stage to another."""
        world, move = self._world, stage.move
        end_mm = move.position_mm(time_s)
        moved = end_mm - world.scale_mm
        self._direction = np.where(moved != 0, np.sign(moved), self._direction)
        travel_s = max(0.0, min(time_s, move.duration_s) - since_s)
        world.advance_to(end_mm, world.posture, time_s - since_s, travel_s)

    def _add_row(self, point: int | None, *, measured: bool, same_visit: bool = False) -> None:
        self._visit += not same_visit
        self._log.add(SESSION, self._visit, point, self._direction, measured)
