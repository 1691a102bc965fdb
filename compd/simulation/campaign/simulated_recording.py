"""A complete recording of a simulated campaign: columns, sidecar, and the causes that were hidden."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from compd.arrays import FloatArray
from compd.configuration import Configuration, Geometry, shipped_configuration, shipped_names
from compd.operation_settings import Wiring
from compd.recording import sidecar_contents
from compd.simulation.campaign.campaign import MAX_WAIT_S, Campaign
from compd.simulation.campaign.campaign_plan import PASS_ROW_EVERY_S, REPEAT_AFTER_S, CampaignPlan, draw_campaign_plan
from compd.simulation.campaign.row_log import LoggedRows, RowLog
from compd.simulation.causes.catalogue import CAUSES, build_cause, possible_causes, shuffle_causes
from compd.simulation.causes.hidden_cause import HiddenCause, SizedCause
from compd.simulation.truth.cause import Cause
from compd.simulation.truth.fixed_places import (
    PROBE_RADIUS_MM,
    TOUCHED_RADIUS_MM,
    FixedPlaces,
    ballbar_places,
    pin_places,
    touched_ball_places,
)
from compd.simulation.truth.heat import HELD_TIME_CONSTANT_S
from compd.simulation.truth.instruments import INSTRUMENTS, TRACKER_SIGMA_UM, Kind, ReferenceInstrument, ball_plate_mm
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.plan_motion import Stage, plan_stages
from compd.simulation.truth.planned_row import PlannedRow
from compd.simulation.truth.strengths import FULLY_MEASURED, FULLY_MEASURED_WITHOUT_NOISE, Strengths, seen_by
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


# Number of visits and passes of which one is run to measure the size of the error.
KEEP_ONE_IN = 6
FIRST_SHARE = 0.2
GOOD_ENOUGH = 0.05
MAX_TRIES = 4
# Number and size of the weak disturbances in every campaign; size as a share of the reference's noise.
WEAK_FLOORS = 0.2
WEAK_CAUSES = 2


class CauseSizer:
    """Sizes causes on the machine of `seed`."""

    def __init__(
        self,
        geometry: Geometry,
        wiring: Wiring,
        seed: int,
        floor_um: float = TRACKER_SIGMA_UM,
        air_at_zero: AirAtZero = STANDARD_AIR,
        plan: CampaignPlan | None = None,
    ) -> None:
        """plan : in which an error has its size; left out: the machine's usual campaign."""
        self._geometry, self._wiring, self._seed, self._floor_um = geometry, wiring, seed, floor_um
        self.mechanism = Mechanism(geometry)
        self.plan = plan or draw_campaign_plan(self.mechanism, seed, air_at_zero=air_at_zero)
        self._short = self.plan.thinned(KEEP_ONE_IN)

    def error_in_floors(self, cause: Cause) -> float:
        """rms of the tip's error that the gauges do not measure, over the noise floor.

        The cause's memory is changed: build a new one for further use.
        """
        # a thinned plan has too few rows on the move
        days = self.plan if cause.only_in_motion else self._short
        strengths = seen_by(FULLY_MEASURED_WITHOUT_NOISE, len(self._wiring.joint))
        campaign = Campaign(self._geometry, self._wiring, days, self._seed, strengths, [cause])
        return campaign.run().error_um() / self._floor_um

    def size(self, hidden: HiddenCause) -> SizedCause:
        """The cause with the strength asked for, or with that for the size asked for, within its plausible range.

        Assumes that the error is proportional to the strength, and corrects it in at most MAX_TRIES tries.
        """
        if hidden.strength is not None:
            floors = self.error_in_floors(self._build(hidden.id, hidden.strength))
            return SizedCause(self._build(hidden.id, hidden.strength), floors)
        kind = CAUSES[hidden.id]
        strength, floors = FIRST_SHARE * kind.max_strength, 0.0
        for _ in range(MAX_TRIES):
            floors = self.error_in_floors(self._build(hidden.id, strength))
            if floors == 0 or abs(floors / hidden.floors - 1) < GOOD_ENOUGH:
                break
            wanted = min(max(strength * hidden.floors / floors, kind.min_strength), kind.max_strength)
            if wanted == strength:
                break
            strength = wanted
        return SizedCause(self._build(hidden.id, strength), floors)

    def weak_disturbances(self, besides: Sequence[str]) -> list[Cause]:
        """WEAK_CAUSES causes other than `besides`, each too weak to be found by a diagnosis."""
        others = [name for name in possible_causes(self.mechanism, self._wiring) if name not in besides]
        causes = []
        for name in shuffle_causes(others, self._seed, "weak")[:WEAK_CAUSES]:
            largest = CAUSES[name].max_strength
            strength = FIRST_SHARE * largest
            floors = self.error_in_floors(self._build(name, strength))
            # a cause with a negligible effect here keeps its largest plausible strength
            causes.append(self._build(name, min(strength * WEAK_FLOORS / floors, largest) if floors > 0 else strength))
        return causes

    def _build(self, name: str, strength: float) -> Cause:
        return build_cause(name, strength, self.mechanism, self._seed)


OUTLIER_SHARE = 0.01
QUANTITY: Mapping[Kind, str] = {
    "tracker": "tool_position",
    "interferometer": "link_length",
    "ball_plate": "ball_plate",
    "ballbar": "distance",
    "pin": "fixed_point",
    "ball": "distance",
    "pose": "tool_pose",
}
FIXED: Mapping[Kind, Callable[[Mechanism, np.random.Generator], FixedPlaces]] = {
    "ballbar": ballbar_places,
    "pin": pin_places,
    "ball": touched_ball_places,
}


@dataclass(frozen=True)
class SimulatedRecording:
    """columns : by name with unit, (N,). sidecar : for NAME.yaml. balls_M : (17, 3) of the ball plate, or None.

    hidden : the causes asked for. weak : disturbances in addition. Both for the answer file only.
    """

    columns: Mapping[str, Sequence[float]]
    sidecar: Mapping[str, Any]
    balls_M: FloatArray | None
    hidden: tuple[SizedCause, ...]
    weak: tuple[Cause, ...]

    @property
    def reference_columns(self) -> list[str]:
        """Names of the reference's coordinates; their values are nan where only the gauges were read."""
        return [name for name in self.columns if name.startswith("reference_")]


def simulate_recording(
    configuration: Configuration,
    seed: int,
    hidden: Sequence[HiddenCause],
    reference: Kind = "tracker",
    plate_file: str = "",
    other_days: int = 0,
    planned_rows: Sequence[PlannedRow] = (),
    air_at_zero: AirAtZero = STANDARD_AIR,
) -> SimulatedRecording:
    """Run one campaign.

    seed : of machine, parts and noise. other_days : number of another campaign on the same machine.
    plate_file : name of the ball plate's file, for the sidecar. planned_rows : measure these rows instead of a drawn
    plan; not with a ball plate, whose balls have fixed places. air_at_zero : when machine zero is taken.
    """
    geometry, wiring = configuration.geometry, configuration.wiring
    sizer = CauseSizer(geometry, wiring, seed, max(INSTRUMENTS[reference].sigma_um, TRACKER_SIGMA_UM), air_at_zero)
    sized = tuple(sizer.size(cause) for cause in hidden)
    weak = sizer.weak_disturbances([cause.id for cause in hidden])
    causes = [*(cause.cause for cause in sized), *weak]
    instrument = replace(INSTRUMENTS[reference], outlier_share=OUTLIER_SHARE)
    strengths = seen_by(FULLY_MEASURED, len(wiring.joint))
    campaign: Campaign | PlannedCampaign
    balls_M = None
    if planned_rows:
        campaign = PlannedCampaign(
            geometry, wiring, planned_rows, seed, other_days, strengths, causes, instrument, air_at_zero
        )
    else:
        balls_M, places, days = _days(sizer.mechanism, reference, seed, other_days, air_at_zero)
        campaign = Campaign(
            geometry, wiring, days, seed, strengths, causes, reference=instrument, balls_M=balls_M, places=places
        )
    reference_block: dict[str, Any] = {"quantity": QUANTITY[reference], "sigma_um": instrument.sigma_um}
    if reference in ("tracker", "pose"):
        reference_block["frame"] = "machine"
    if reference == "pose":
        reference_block["sigma_urad"] = instrument.sigma_urad
    if reference == "ball":
        reference_block |= {"radius_mm": TOUCHED_RADIUS_MM + PROBE_RADIUS_MM, "absolute": True}
    if balls_M is not None:
        reference_block["balls"] = plate_file
    logged = campaign.run()
    shipped = {shipped_configuration(f"{name}.yaml").resolve() for name in shipped_names()}
    sidecar = sidecar_contents(
        configuration.machine,
        reference_block,
        quantities_at_zero=logged.quantities_at_zero,
        # a shipped one is found by its name
        machine_file=None if configuration.path.resolve() in shipped else configuration.path,
    )
    return SimulatedRecording(logged.columns, sidecar, balls_M, sized, tuple(weak))


def _days(
    mechanism: Mechanism, reference: Kind, seed: int, number: int, air: AirAtZero
) -> tuple[FloatArray | None, FixedPlaces | None, CampaignPlan]:
    """Balls of a plate (17, 3) or None, fixed balls or pins or None, and the plan.

    What is fixed is where the plan's points are, and without passes: nothing is measured on the way.
    """
    if reference in FIXED:
        places = FIXED[reference](mechanism, np.random.default_rng([seed, 5, number]))
        return (
            None,
            places,
            draw_campaign_plan(mechanism, seed, number, points_mm=places.scale_mm, passes=0, air_at_zero=air),
        )
    if reference != "ball_plate":
        return None, None, draw_campaign_plan(mechanism, seed, number, air_at_zero=air)
    balls_M = ball_plate_mm(mechanism.tip0_M)
    turn_rad = np.zeros(3)
    postures = [mechanism.posture_at(ball_M, turn_rad) for ball_M in balls_M]
    points_mm = np.array([mechanism.scales_at(posture) for posture in postures])
    return balls_M, None, draw_campaign_plan(mechanism, seed, number, points_mm=points_mm, passes=0, air_at_zero=air)
