"""A planned measurement on the simulated machine, without wires and without waiting: rows of a recording."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from compd.arrays import FloatArray
from compd.configuration.geometry import Geometry
from compd.configuration.operation import Wiring
from compd.simulation.campaign.campaign import LONGEST_WAIT_S
from compd.simulation.campaign.campaign_plan import PASS_ROW_EVERY_S, REPEAT_AFTER_S
from compd.simulation.campaign.row_log import LoggedRows, RowLog
from compd.simulation.truth.cause import Cause
from compd.simulation.truth.heat import HELD_TIME_CONSTANT_S
from compd.simulation.truth.instruments import Kind
from compd.simulation.truth.planned_row import PlannedRow
from compd.simulation.truth.stages import Stage, stages
from compd.simulation.truth.strengths import Strengths
from compd.simulation.truth.weather import Weather
from compd.simulation.truth.world import World

SESSION = 1


class PlannedCampaign:
    """One run of a given plan on one machine.

    Between the plan's rows the gauges are read without the reference, so that who reads the recording knows where
    the links and the temperatures have been: at every turn, while parts warm up, before and after a row on the move.
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
        *,
        reference: Kind,
        sigma_um: float,
        outlier_share: float,
    ) -> None:
        """`seed`: joints follow from it. `number`: other weather and noise. `sigma_um`: of the reference."""
        weather = Weather(strengths.room_swing_K, np.random.default_rng([seed, 1, number]))
        self._world = World(geometry, wiring, seed, strengths=strengths, causes=causes, weather=weather)
        rng = np.random.default_rng([seed, 4, number])
        self._notes = RowLog(self._world, wiring, rng, reference, sigma_um, outlier_share)
        self._given = rows
        self._direction: FloatArray = np.ones(geometry.links)
        self._visit = 0

    def run(self) -> LoggedRows:
        """Raises KinematicsError where a place cannot be reached."""
        for stage in stages(self._given, self._world.scale_mm, self._world.hold):
            if stage.purpose != "look":
                self._spend(stage)
            elif stage.row.on_the_move:
                self._pass(stage)
            else:
                self._rest(stage)
        return self._notes.rows

    def _spend(self, stage: Stage) -> None:
        """A way or a wait, with readings of the gauges as often as it takes to follow what happens."""
        every_s = HELD_TIME_CONSTANT_S if stage.purpose == "settle" else LONGEST_WAIT_S
        steps = int(np.ceil(stage.duration_s / every_s))
        for k in range(steps):
            self._go_on(stage, k * stage.duration_s / steps, (k + 1) * stage.duration_s / steps)
            self._note(None, measured=False)

    def _rest(self, stage: Stage) -> None:
        """At a row at rest the reference looks twice: their scatter is its noise."""
        self._go_on(stage, 0.0, stage.duration_s)
        self._note(stage.row.point, measured=True)
        self._go_on(stage, stage.duration_s, stage.duration_s + REPEAT_AFTER_S)
        self._note(stage.row.point, measured=True, same_visit=True)

    def _pass(self, stage: Stage) -> None:
        """Past the row at constant speed: measured in the middle, gauges read shortly before and after, and at rest."""
        middle_s = stage.move.duration_s / 2
        times_s = [middle_s - PASS_ROW_EVERY_S, middle_s, middle_s + PASS_ROW_EVERY_S, stage.duration_s]
        for since_s, time_s in zip([0.0, *times_s], times_s, strict=False):
            self._go_on(stage, since_s, time_s)
            self._note(None, measured=time_s == middle_s)

    def _go_on(self, stage: Stage, since_s: float, time_s: float) -> None:
        """From one time of the stage to another."""
        world, move = self._world, stage.move
        end_mm = move.position_mm(time_s)
        moved = end_mm - world.scale_mm
        self._direction = np.where(moved != 0, np.sign(moved), self._direction)
        travel_s = max(0.0, min(time_s, move.duration_s) - since_s)
        world.carry(end_mm, world.posture, time_s - since_s, travel_s)

    def _note(self, point: int | None, *, measured: bool, same_visit: bool = False) -> None:
        self._visit += not same_visit
        self._notes.add(SESSION, self._visit, point, self._direction, measured)
